//! Calibration of cameras whose true parameters are known: lens, mount, clock; and its effect on the frames of a real building.

mod building;
mod clocks;
mod lenses;
mod mounts;

use clap::Args;

use crate::arguments::{Data, Seeds};
use crate::images::Output;
use crate::report::Report;

/// Errors of `yamabico calibrate` on rendered boards and corridors, and the wall-follower before and after it on real frames.
///
/// Lenses: 15 pictures of a held board for each seed, with noise, blur, uneven light and distortion. Mounts: 30 frames of a drive along
/// a new corridor, half of them cropped; a board on the floor. Clocks: 20 s of turns. Real frames (`multi_floor/`): calibrated on one
/// floor and scored on the other. Images: the pictures of the boards, and the overlays of the mounts.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    seeds: Seeds,
    #[command(flatten)]
    data: Data,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let seeds = self.seeds.or(101..121);
        let mut tables = Vec::from(lenses::tables(seeds.clone(), out)?);
        tables.extend(mounts::tables(seeds.clone(), out)?);
        tables.push(clocks::table(seeds)?);
        if let Some(folder) = self.data.set("multi_floor") {
            tables.push(building::table(&folder, out)?);
        }
        Ok(Report::new(tables))
    }
}

/// Adds a row with the median, the 95 % percentile and the maximum of absolute errors.
fn errors_row(table: &mut crate::report::Table, name: &str, errors: &[f64], of: usize) {
    use crate::report::number;
    use crate::statistics::percentile;
    let absolute: Vec<f64> = errors.iter().map(|error| error.abs()).collect();
    table.row([
        name.into(),
        absolute.len().into(),
        of.into(),
        number(percentile(&absolute, 0.5), 3),
        number(percentile(&absolute, 0.95), 3),
        number(percentile(&absolute, 1.0), 3),
    ]);
}

/// Columns of a table of errors.
const COLUMNS: [&str; 6] = ["error", "measured", "of", "median", "95 %", "max"];
