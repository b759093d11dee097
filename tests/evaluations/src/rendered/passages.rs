//! Classification of gaps and surfaces by sonar.

use clap::Args;
use yamabico_rigs::passages::{CLEAN, POOR, Tally};

use crate::arguments::Seeds;
use crate::report::{Report, Table, number, percent};
use crate::statistics::percentile;

/// Rate at which sonar readings tell a passage from a surface that fills it, in a world per seed, half of them with a passage.
///
/// Undecided worlds count as errors.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    seeds: Seeds,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let mut table = Table::new(
            "Passages and surfaces",
            &[
                "sonar",
                "worlds",
                "correct",
                "correct, %",
                "undecided",
                "passages missed",
                "surfaces missed",
                "decided after, median, s",
                "95 %, s",
                "max, s",
            ],
        );
        for sonar in [CLEAN, POOR] {
            let tally = Tally::of(&sonar, self.seeds.or(0..200))?;
            table.row([
                sonar.name.into(),
                tally.cases.into(),
                tally.correct.into(),
                percent(f64::from(tally.correct), f64::from(tally.cases)),
                tally.undecided.into(),
                tally.passages_missed.into(),
                tally.surfaces_missed.into(),
                number(percentile(&tally.decided_s, 0.5), 2),
                number(percentile(&tally.decided_s, 0.95), 1),
                number(percentile(&tally.decided_s, 1.0), 1),
            ]);
        }
        Ok(Report::new([table]))
    }
}
