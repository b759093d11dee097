//! `yamabico top`: a running robot in the terminal.

use std::io::IsTerminal;

use clap::Args;
use yamabico_view::live::LiveRobot;
use yamabico_view::top::show;

use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, DONE, Failure};
use crate::robot_argument::RobotArgument;

/// Arguments of `top`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    robot: RobotArgument,
}

/// Shows the robot until `q` or Ctrl-C.
pub fn top(arguments: &Arguments) -> CommandResult {
    let robot = LiveRobot::join(&arguments.robot.choose()?)?;
    if !std::io::stdout().is_terminal() {
        return Err(Failure::usage(
            "`top` needs a terminal: use `yamabico ps` or `yamabico why` in a script",
        ));
    }
    let interrupt = interrupt_flag()?;
    show(robot, &interrupt).map_err(Failure::device)?;
    Ok(DONE)
}
