//! A recorded run, read for its report.

use std::path::{Path, PathBuf};

use serde_json::Value;
use yamabico_core::message::{Goal, Message, MessageType, WallPoint, WallsHeader};
use yamabico_core::time::Time;
use yamabico_host::config::GoalArea;

use super::moments::Moments;
use super::timeline::Timeline;
use super::{Corner, ReferenceLine, RunFacts, SummaryTap, Trace};
use crate::record::{PlaybackError, RecordedFacts, Tap, Tee, play_compressed, read_facts};

/// A recorded run.
pub(super) struct Recorded {
    /// File.
    pub path: PathBuf,
    /// Facts before and after the run.
    pub facts: RecordedFacts,
    /// Summary: of the run, or computed from the messages if the recorder was killed before its end.
    pub summary: Value,
    /// Path of the robot.
    pub trace: Trace,
    /// Control, speeds, events.
    pub timeline: Timeline,
    /// Pictures of halts.
    pub moments: Moments,
    /// Walls of the map.
    pub walls: Vec<Vec<Corner>>,
    /// Goal area.
    pub goal: Option<GoalArea>,
    /// Cause why the recording ends early.
    pub broken_off: Option<String>,
    /// Messages that were left out.
    pub left_out: Vec<String>,
}

/// Walls and goal from messages.
#[derive(Default)]
struct Places {
    walls: Vec<Vec<Corner>>,
    goal: Option<GoalArea>,
}

impl Tap for Places {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        match message.name {
            WallsHeader::NAME => {
                let corners = items.chunks_exact(size_of::<WallPoint>());
                let corners: Vec<WallPoint> = corners.map(bytemuck::pod_read_unaligned).collect();
                let walls = corners.chunk_by(|a, b| a.line == b.line);
                self.walls = walls.map(|wall| wall.iter().map(|at| [at.x, at.y]).collect()).collect();
            }
            Goal::NAME => {
                let goal = bytemuck::try_pod_read_unaligned::<Goal>(header).ok();
                let goal = goal.filter(|goal| goal.x.is_finite() && goal.y.is_finite());
                self.goal = goal
                    .map(|goal| GoalArea { x_m: goal.x, y_m: goal.y, tolerance_m: goal.tolerance_m })
                    .or(self.goal);
            }
            _ => {}
        }
    }
}

impl Recorded {
    /// Reads a recording. One that ends early is read up to its end.
    ///
    /// # Errors
    /// The file cannot be read or is no recording.
    pub fn read(path: &Path) -> Result<Recorded, PlaybackError> {
        let facts = read_facts(path)?;
        let mut summary = SummaryTap::new(ReferenceLine::default());
        let (mut trace, mut timeline) = (Trace::default(), Timeline::default());
        let (mut places, moments) = (Places::default(), std::cell::RefCell::new(Moments::default()));
        let played = {
            let mut shared = Shared(&moments);
            let mut taps = Tee(vec![&mut summary, &mut trace, &mut timeline, &mut places, &mut shared]);
            let mut frames = |topic: &str, header: &_, image: &[u8]| {
                moments.borrow_mut().frame(topic, header, image);
            };
            play_compressed(path, &mut taps, &mut frames)?
        };
        let json = |key: &str| serde_json::from_str::<Value>(facts.result.get(key)?).ok();
        let walls = json("walls").and_then(|walls| serde_json::from_value(walls).ok());
        let summary = match json("summary").filter(Value::is_object) {
            Some(summary) => summary,
            // Its fields are numbers and texts: it always becomes JSON.
            None => serde_json::to_value(summary.finish(RunFacts::default())).unwrap_or_default(),
        };
        let goal = facts.run.get("goal").and_then(|goal| serde_json::from_str::<Value>(goal).ok());
        let goal = goal.as_ref().and_then(goal_area);
        Ok(Recorded {
            path: path.to_owned(),
            summary,
            walls: walls.unwrap_or(places.walls),
            goal: goal.or(places.goal),
            facts,
            trace,
            timeline,
            moments: moments.into_inner(),
            broken_off: played.broken_off,
            left_out: played.left_out.into_iter().collect(),
        })
    }
}

/// Passes messages to moments that also receive frames.
struct Shared<'a>(&'a std::cell::RefCell<Moments>);

impl Tap for Shared<'_> {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, header: &[u8], items: &[u8]) {
        self.0.borrow_mut().message(topic, message, time, header, items);
    }
}

fn goal_area(goal: &Value) -> Option<GoalArea> {
    let number = |key: &str| goal.get(key)?.as_f64();
    Some(GoalArea { x_m: number("x_m")?, y_m: number("y_m")?, tolerance_m: number("tolerance_m")? })
}
