//! Buildings drawn from seeds: tasks in each of them, and results by property.

mod bands;
mod encounter;
mod tables;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;
use yamabico::building::{WITH_MAP, WITHOUT_MAP, find_repository, write};
use yamabico::plugins::plugins;
use yamabico_host::config::Overrides;
use yamabico_learning::TaskSource;
use yamabico_learning::thresholds::{self, learn};
use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::run::{Options, run};
use yamabico_sim::building::{Building, Properties};

use self::encounter::{Encounter, EncounterTap};
use crate::arguments::Seeds;
use crate::report::Report;
use crate::tasks::{load_task, sweep};

const AVOIDER: &str = "behaviors.stationary-obstacle-avoider";
/// Distance between places where thresholds are learned, m.
const PLACE_SPACING_M: f64 = 0.5;

/// Drive through buildings drawn from seeds, with boxes and people, and compare the results by property.
///
/// The tasks are those of `yamabico new building SEED`. Figures of seeds that were used while building tell nothing: `tests/RESULTS.md` names them.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    seeds: Seeds,
    /// Number of buildings at a time.
    #[arg(long, default_value_t = 1)]
    jobs: usize,
    /// Only the task with a map.
    #[arg(long, conflicts_with = "no_map")]
    map: bool,
    /// Only the task without a map.
    #[arg(long)]
    no_map: bool,
    /// Learn the avoider's thresholds in each empty building before the task with a map, and use its method `passages`.
    #[arg(long)]
    learn: bool,
    /// People who do not see the robot and never wait for it.
    #[arg(long)]
    blind: bool,
    /// Property of all buildings, such as `floor = "mirror"`; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    building: Vec<String>,
    /// Change a key of the tasks; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Table of all runs to write, with the properties of their buildings.
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Folder that keeps the files of the buildings.
    #[arg(long, value_name = "DIR")]
    folder: Option<PathBuf>,
}

/// One run in one building.
pub struct Run {
    /// Seed of the building and of the run.
    pub seed: u64,
    /// Properties of the building.
    pub properties: Properties,
    /// True for the task with a map.
    pub has_map: bool,
    /// True if the robot reached the goal.
    pub has_arrived: bool,
    /// Duration, s.
    pub time_s: f64,
    /// World x at the end, m.
    pub end_x_m: f64,
    /// Minimum clearance, m.
    pub clearance_m: Option<f64>,
    /// Contacts with boxes, walls and people.
    pub encounters: Vec<Encounter>,
}

impl Run {
    /// Number of contacts that the robot drove into.
    pub fn driven_into(&self) -> usize {
        self.encounters.iter().filter(|encounter| encounter.is_driven_into()).count()
    }

    /// Number of times that a person touched the robot.
    pub fn touched(&self) -> usize {
        self.encounters.len() - self.driven_into()
    }
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let repository = find_repository(None)?;
        let process = std::process::id();
        let scratch = std::env::temp_dir().join(format!("yamabico-buildings-{process}"));
        let folder = self.folder.as_ref().unwrap_or(&scratch);
        let runs = sweep(self.seeds.or(1..21), self.jobs, |seed| self.visit(seed, folder, &repository));
        if self.folder.is_none() {
            // Nothing is left of it even if a run failed.
            let _ = std::fs::remove_dir_all(&scratch);
        }
        let runs: Vec<Run> = runs?.into_iter().flatten().collect();
        if let Some(file) = &self.csv {
            std::fs::write(file, tables::csv(&runs))
                .map_err(|error| format!("{}: {error}", file.display()))?;
        }
        Ok(Report::new(tables::tables(&runs)))
    }

    /// Runs the tasks in the building of a seed.
    fn visit(&self, seed: u64, folder: &Path, repository: &Path) -> Result<Vec<Run>, String> {
        let blind = self.blind.then(|| "gives_way_m = 0.0".to_owned());
        let overrides: Vec<String> = self.building.iter().cloned().chain(blind).collect();
        let building = Building::new(seed, &overrides).map_err(|problems| problems.to_string())?;
        let folder = folder.join(format!("building-{seed}"));
        write(&building, &folder, repository)?;
        let tasks = [(WITH_MAP, true, !self.no_map), (WITHOUT_MAP, false, !self.map)];
        let chosen = tasks.into_iter().filter(|(.., chosen)| *chosen);
        chosen.map(|(file, has_map, _)| self.drive(&building, &folder.join(file), has_map)).collect()
    }

    fn drive(&self, building: &Building, file: &Path, has_map: bool) -> Result<Run, String> {
        let mut set = self.set.clone();
        if has_map && self.learn {
            set.extend(learned(file, building.seed)?);
        }
        let task = load_task(file, &set)?;
        let options = Options { seed: building.seed, ..Options::default() };
        let mut tap = EncounterTap::new(&building.world, building.seed, task.robot.robot.radius_m);
        let result = run(&task, &options, &AtomicBool::new(false), &mut tap, &mut |_| {})
            .map_err(|error| format!("{}: {error}", file.display()))?;
        Ok(Run {
            seed: building.seed,
            properties: building.properties,
            has_map,
            has_arrived: result.end == RunEnd::Arrived,
            time_s: result.summary.time_s,
            end_x_m: tap.end_x_m(),
            clearance_m: result.summary.smallest_clearance_m,
            encounters: tap.encounters,
        })
    }
}

/// Learns thresholds in the empty building; returns the changes of the task that use them.
fn learned(file: &Path, seed: u64) -> Result<Vec<String>, String> {
    let set = vec!["robot.devices.sim.clutter=\"none\"".to_owned()];
    let source = TaskSource {
        file: file.to_owned(),
        overrides: Overrides { robot: None, set },
        plugins: plugins(),
        seed,
        live: None,
        interrupt: Arc::default(),
    };
    let options = thresholds::Options {
        table: file.with_file_name("thresholds.toml"),
        plot: file.with_file_name("thresholds.png"),
        spacing_m: PLACE_SPACING_M,
        recording: None,
    };
    let learned = learn(&source, &options, &mut |_, _| {}).map_err(|error| error.to_string())?;
    let mut set = vec![format!("{AVOIDER}.method=\"passages\"")];
    if let Some(table) = learned.table.filter(|_| !learned.places.is_empty()) {
        // Paths of changes are relative to the working directory.
        let table = std::path::absolute(table).map_err(|error| error.to_string())?;
        set.push(format!("{AVOIDER}.thresholds={:?}", table.display().to_string()));
    }
    Ok(set)
}
