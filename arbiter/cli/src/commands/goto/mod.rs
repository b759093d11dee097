//! `yamabico goto`: one or several goals for a running robot.

mod goals;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use indicatif::ProgressBar;
use yamabico_runtime::client::{GoalProgress, GoalRequest, RobotClient};

use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, DONE, Failure, Print};
use crate::progress::set_style;
use crate::robot_argument::RobotArgument;

/// Time between two looks at the remaining distance.
const PERIOD: Duration = Duration::from_millis(50);

/// Arguments of `goto`.
#[derive(Args)]
pub struct Arguments {
    /// X and Y of the goal on the map, m, or a TOML file of goals: `[[goal]]` with `x_m`, `y_m`, `heading_deg`, `tolerance_m`.
    #[arg(required = true, num_args = 1..=2, value_names = ["X|FILE", "Y"], allow_negative_numbers = true)]
    goal: Vec<String>,
    /// Heading at the goal, degrees, positive to the left; by default any.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    heading: Option<f64>,
    /// Distance from the goal at which it is reached, m.
    #[arg(long, value_name = "M", default_value_t = goals::tolerance_m())]
    tolerance: f64,
    #[command(flatten)]
    robot: RobotArgument,
    /// Name of the behavior that plans the path; by default the only one that publishes a path.
    #[arg(long, value_name = "NAME")]
    behavior: Option<String>,
    /// Return as soon as a path is planned, instead of waiting until the robot arrives.
    #[arg(long)]
    no_wait: bool,
}

/// Sends the robot to each goal in turn and waits until it arrives.
pub fn goto(arguments: &Arguments, print: Print) -> CommandResult {
    let goals = goals::read(arguments)?;
    let robot = arguments.robot.choose()?;
    let interrupt = interrupt_flag()?;
    let mut client = RobotClient::join(&robot)?;
    let progress = client.goal_progress(arguments.behavior.as_deref())?;
    for goal in &goals {
        let request = GoalRequest {
            x_m: goal.x_m,
            y_m: goal.y_m,
            heading_rad: goal.heading_deg.map(f64::to_radians),
            tolerance_m: goal.tolerance_m,
        };
        let to_go_m = client.send_goal(&request, &progress)?;
        if !arguments.no_wait {
            wait(&client, &progress, &request, to_go_m, &interrupt)?;
        }
    }
    print.show(&goals, |goals| {
        let verb = if arguments.no_wait { "driving to" } else { "arrived at" };
        let goals = goals.iter().map(|goal| format!("({}, {})", goal.x_m, goal.y_m));
        format!("{robot}: {verb} {}", goals.collect::<Vec<_>>().join(", "))
    });
    Ok(DONE)
}

/// Waits until the rest of the path is shorter than the tolerance.
fn wait(
    client: &RobotClient,
    progress: &GoalProgress,
    goal: &GoalRequest,
    path_m: f64,
    interrupt: &AtomicBool,
) -> Result<(), Failure> {
    let bar = ProgressBar::new((path_m * 1000.0) as u64);
    set_style(&bar, &format!("({}, {})", goal.x_m, goal.y_m));
    let mut to_go_m = path_m;
    while to_go_m > goal.tolerance_m {
        if interrupt.load(Ordering::Relaxed) {
            bar.abandon();
            return Err(Failure::not_done("stopped waiting; the robot keeps driving to its goal"));
        }
        if !client.is_running() {
            bar.abandon();
            let problem =
                format!("robot `{}` stopped running {to_go_m:.2} m before the goal", client.robot());
            return Err(Failure::not_done(problem));
        }
        std::thread::sleep(PERIOD);
        to_go_m = progress.to_go_m(goal).map_err(Failure::device)?.unwrap_or(to_go_m);
        bar.set_position(((path_m - to_go_m) * 1000.0).max(0.0) as u64);
        bar.set_message(format!("{to_go_m:.2} m to go"));
    }
    bar.finish_and_clear();
    Ok(())
}
