//! `yamabico goto`: a new goal, or several one after the other, for a running robot.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use yamabico_parameters::FileKind;
use yamabico_runtime::operator::{Operator, Place};

use super::run::interrupt_flag;
use crate::live::which::Which;
use crate::output::{BAD_CONFIGURATION, DEVICE_FAILED, DONE, NOT_ARRIVED, Print, exit, fail};

/// What `goto` is told.
#[derive(Args)]
pub struct Arguments {
    /// X and Y of the goal on the map, meters, or a TOML file of goals: `[[goal]]` with `x_m`, `y_m`, `heading_deg`, `tolerance_m`.
    #[arg(required = true, num_args = 1..=2, value_names = ["X|FILE", "Y"], allow_negative_numbers = true)]
    goal: Vec<String>,
    /// Heading at the goal, degrees, positive to the left; any without it.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    heading: Option<f64>,
    /// How near is there, meters.
    #[arg(long, value_name = "M", default_value_t = tolerance())]
    tolerance: f64,
    #[command(flatten)]
    robot: Which,
    /// The behavior that plans the path.
    #[arg(long, value_name = "NAME", default_value = "map-localizer")]
    behavior: String,
    /// Do not wait until the robot is there.
    #[arg(long)]
    no_wait: bool,
}

/// A file of goals.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Goals {
    /// One after the other.
    #[serde(rename = "goal")]
    #[schemars(length(min = 1, max = 1000))]
    goals: Vec<GoalKeys>,
}

/// A goal on the map.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GoalKeys {
    /// Meters, -100000 to 100000.
    #[schemars(range(min = -100_000.0, max = 100_000.0))]
    x_m: f64,
    /// Meters, -100000 to 100000.
    #[schemars(range(min = -100_000.0, max = 100_000.0))]
    y_m: f64,
    /// Degrees, positive to the left, -180 to 180; any heading when absent.
    #[serde(default)]
    #[schemars(range(min = -180.0, max = 180.0))]
    heading_deg: Option<f64>,
    /// How near is there, meters, 0.01 to 100, default 0.3.
    #[serde(default = "tolerance")]
    #[schemars(range(min = 0.01, max = 100.0))]
    tolerance_m: f64,
}

const GOALS_FILE: FileKind =
    FileKind { key: "goals", what: "a file of goals", schema: || schema_for!(Goals), rules: |_| Vec::new() };

/// Sends the robot to each goal and waits until it is there.
pub fn goto(arguments: &Arguments, print: Print) -> ExitCode {
    let goals = match read_goals(arguments, print) {
        Ok(goals) => goals,
        Err(code) => return code,
    };
    let robot = match arguments.robot.choose() {
        Ok(robot) => robot,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    let mut operator = match Operator::join(&robot, &arguments.behavior) {
        Ok(operator) => operator,
        Err(error) => return fail(&error.to_string(), BAD_CONFIGURATION),
    };
    for goal in &goals {
        let place = Place {
            x_m: goal.x_m,
            y_m: goal.y_m,
            heading: goal.heading_deg.map(f64::to_radians),
            tolerance_m: goal.tolerance_m,
        };
        let to_go_m = match operator.go_to(&place) {
            Ok(to_go_m) => to_go_m,
            Err(error) => return fail(&error.to_string(), NOT_ARRIVED),
        };
        if !arguments.no_wait
            && let Err((problem, code)) = wait(&operator, &robot, &place, to_go_m)
        {
            return fail(&problem, code);
        }
    }
    print.show(&goals, |goals| {
        let verb = if arguments.no_wait { "on its way" } else { "arrived" };
        let places = goals.iter().map(|goal| format!("({}, {})", goal.x_m, goal.y_m));
        format!("{robot}: {verb} {}", places.collect::<Vec<_>>().join(", "))
    });
    exit(DONE)
}

/// Until the path ends within the tolerance.
fn wait(operator: &Operator, robot: &str, place: &Place, path_m: f64) -> Result<(), (String, u8)> {
    let interrupt =
        interrupt_flag().map_err(|error| (format!("cannot listen for Ctrl-C: {error}"), DEVICE_FAILED))?;
    let bar = ProgressBar::new((path_m * 1000.0) as u64);
    if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {msg}") {
        bar.set_style(style);
    }
    bar.set_prefix(format!("({}, {})", place.x_m, place.y_m));
    let mut to_go_m = path_m;
    while to_go_m > place.tolerance_m {
        if interrupt.load(Ordering::Relaxed) {
            bar.abandon();
            return Err(("no longer waiting; the robot drives on to its goal".into(), NOT_ARRIVED));
        }
        if !Operator::is_running(robot) {
            bar.abandon();
            return Err((
                format!("the robot `{robot}` runs no more, {to_go_m:.2} m before the goal"),
                NOT_ARRIVED,
            ));
        }
        std::thread::sleep(Duration::from_millis(50));
        let news = operator.to_go_m(place).map_err(|error| (error.to_string(), DEVICE_FAILED))?;
        to_go_m = news.unwrap_or(to_go_m);
        bar.set_position(((path_m - to_go_m) * 1000.0).max(0.0) as u64);
        bar.set_message(format!("{to_go_m:.2} m to go"));
    }
    bar.finish_and_clear();
    Ok(())
}

fn read_goals(arguments: &Arguments, print: Print) -> Result<Vec<GoalKeys>, ExitCode> {
    let usage = |problem: String| fail(&problem, BAD_CONFIGURATION);
    let keys = match arguments.goal.as_slice() {
        [x, y] => {
            let number = |text: &String| {
                let number = text.parse().ok().filter(|number: &f64| number.abs() <= 100_000.0);
                number
                    .ok_or_else(|| usage(format!("`{text}` is no place on a map: give meters, such as 12.5")))
            };
            let (x_m, y_m, tolerance_m) = (number(x)?, number(y)?, arguments.tolerance);
            if !(0.01..=100.0).contains(&tolerance_m) {
                return Err(usage(format!("--tolerance {tolerance_m} is not between 0.01 and 100 m")));
            }
            let heading_deg = arguments.heading.filter(|heading| heading.is_finite());
            return Ok(vec![GoalKeys { x_m, y_m, heading_deg, tolerance_m }]);
        }
        [file] if file.parse::<f64>().is_ok() => return Err(usage(format!("after X = {file} also give Y"))),
        [file] => Path::new(file),
        _ => return Err(usage("give X and Y, or a file of goals".into())),
    };
    let text = std::fs::read_to_string(keys)
        .map_err(|error| usage(format!("{}: {error}; give X and Y, or a file of goals", keys.display())))?;
    let table = GOALS_FILE.read(&keys.display().to_string(), &text).map_err(|problems| {
        print.problems(&problems);
        exit(BAD_CONFIGURATION)
    })?;
    let goals: Goals =
        table.try_into().map_err(|error: toml::de::Error| usage(format!("{}: {error}", keys.display())))?;
    Ok(goals.goals)
}

fn tolerance() -> f64 {
    0.3
}
