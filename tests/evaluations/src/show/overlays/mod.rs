//! Pictures of what the behaviors of a task drew on the image of the robot's camera, in buildings drawn from seeds.

mod picture;
mod snapshot;

use std::sync::atomic::AtomicBool;

use clap::Args;
use yamabico::building::{WITHOUT_MAP, find_repository, write};
use yamabico_runtime::execution::Overlays;
use yamabico_runtime::run::{Options, run};
use yamabico_sim::building::Building;

use self::snapshot::{Moment, Snapshot, SnapshotTap};
use crate::images::Output;
use crate::render::require_output;
use crate::report::{Report, Table, number};
use crate::tasks::load_task;

/// Pictures of buildings with the same properties.
struct Case {
    /// Property that a picture shows.
    name: &'static str,
    /// Seeds of the buildings, one for each picture.
    seeds: &'static [u64],
    /// Properties of the buildings.
    properties: &'static [&'static str],
    /// Time of the picture.
    moment: Moment,
}

/// A hallway without boxes and people.
const EMPTY: [&str; 2] = ["boxes = 0", "person = \"none\""];

const CASES: [Case; 6] = [
    Case {
        name: "tile",
        seeds: &[11, 12, 13],
        properties: &["floor = \"tiles\"", "joint_contrast = 0.5", EMPTY[0], EMPTY[1]],
        moment: Moment::Driven(3.0),
    },
    Case {
        name: "mirror",
        seeds: &[21, 22, 23],
        properties: &["floor = \"mirror\"", EMPTY[0], EMPTY[1]],
        moment: Moment::Driven(3.0),
    },
    Case {
        name: "person",
        seeds: &[31, 32, 33],
        properties: &["person = \"meets\"", EMPTY[0]],
        moment: Moment::BeforePerson(1.8),
    },
    Case {
        name: "box",
        seeds: &[41, 42],
        properties: &["boxes = 2", EMPTY[1]],
        moment: Moment::BeforeBox(1.5),
    },
    Case {
        name: "poster",
        seeds: &[51, 52],
        properties: &["walls = \"posters\"", EMPTY[0], EMPTY[1]],
        moment: Moment::Driven(3.0),
    },
    Case {
        name: "glare",
        seeds: &[61, 62],
        properties: &["glare = \"sun\"", EMPTY[0], EMPTY[1]],
        moment: Moment::Driven(3.0),
    },
];

/// Fifteen pictures of the robot's camera with what every behavior drew, in buildings drawn from seeds: `DIR/CASE-SEED.png`.
///
/// The task is the one without a map of `yamabico new building SEED`. Where the robot does not get to the moment of the picture, the
/// picture shows the end of the run. What the behaviors drew in the robot frame is projected to the floor; what stands there in the
/// world is outlined white. The text below says seed, properties, time, whether the moment came, and what is occupied.
#[derive(Args)]
pub struct Arguments {
    /// Only these cases, such as `tile`.
    cases: Vec<String>,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        require_output(out)?;
        let mut table = Table::new(
            "Overlays",
            &["case", "seed", "properties", "time, s", "moment", "occupied (forward, left; m)", "avoider"],
        );
        for case in
            CASES.iter().filter(|case| self.cases.is_empty() || self.cases.iter().any(|c| c == case.name))
        {
            for &seed in case.seeds {
                let properties: Vec<String> = case.properties.iter().map(|line| (*line).to_owned()).collect();
                let building = Building::new(seed, &properties).map_err(|problems| problems.to_string())?;
                let snapshot = take(&building, case.moment)?
                    .ok_or_else(|| format!("{} {seed}: the avoider drew over no frame", case.name))?;
                let moment = if snapshot.is_in_time { "came" } else { "did not come: end of the run" };
                let text = [
                    format!("seed {seed}, {}, {:.1} s", case.properties.join(", "), snapshot.time_s),
                    format!("moment: {moment}"),
                    format!("occupied: {}", snapshot.occupied()),
                    format!("avoider: {}", snapshot.note),
                ];
                let image = picture::draw(&building, &snapshot, &text)?;
                let name = format!("{}-{seed}", case.name);
                out.rgb(&name, image.as_raw(), image.width(), image.height())?;
                table.row([
                    case.name.into(),
                    seed.into(),
                    case.properties.join(", ").as_str().into(),
                    number(snapshot.time_s, 1),
                    moment.into(),
                    snapshot.occupied().as_str().into(),
                    snapshot.note.as_str().into(),
                ]);
            }
        }
        Ok(Report::new([table]))
    }
}

/// Drives in a building until the moment has come, or to the end of the run; `None` if the avoider drew over no frame.
fn take(building: &Building, moment: Moment) -> Result<Option<Snapshot>, String> {
    let name = format!("yamabico-overlays-{}-{}", std::process::id(), building.seed);
    let folder = std::env::temp_dir().join(name);
    write(building, &folder, &find_repository(None)?)?;
    let file = folder.join(WITHOUT_MAP);
    let done = AtomicBool::new(false);
    let mut tap = SnapshotTap::new(building, moment, &done);
    let result = load_task(&file, &[]).and_then(|task| {
        // Behaviors draw for a recording only.
        let options = Options {
            seed: building.seed,
            recording: Some(folder.join("run.mcap")),
            overlays: Overlays::Recorded,
            ..Options::default()
        };
        run(&task, &options, &done, &mut tap, &mut |_| {})
            .map_err(|error| format!("{}: {error}", file.display()))
    });
    // Nothing is left of it even if the run failed.
    let _ = std::fs::remove_dir_all(&folder);
    result?;
    Ok(tap.into_snapshot())
}
