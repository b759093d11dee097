//! The commands: one variant and one file each.

mod calibrate;
mod check;
mod describe;
mod estop;
mod goto;
mod graph;
mod import;
mod info;
mod learn;
mod list;
mod new;
mod plugin;
mod ps;
mod repair;
mod replay;
mod report;
mod run;
mod run_table;
mod schema;
mod set;
mod switch;
mod teleop;
#[cfg(feature = "view")]
mod top;
mod topic;
#[cfg(feature = "view")]
mod view;
#[cfg(not(feature = "view"))]
mod view_missing;
mod why;

use clap::Subcommand;

use crate::output::{CommandResult, Print};

/// The subcommand and its arguments.
#[derive(Subcommand)]
pub enum Command {
    /// Run a task until its goal is reached, its time is up or its sensors end.
    Run(run::Arguments),
    /// Check a task and list every error in it, without opening a device; or measure what deadlines it needs.
    Check(check::Arguments),
    /// Draw a task: sensors, behaviors, wires and drive.
    Graph(graph::Arguments),
    /// List behaviors and drivers.
    List,
    /// Describe a behavior, driver, sensor or drive: its inputs, outputs and parameters.
    Describe(describe::Arguments),
    /// Print the JSON Schemas of configuration files, for editors.
    Schema(schema::Arguments),
    /// Create a behavior of your own, or draw a building to drive in.
    #[command(subcommand)]
    New(new::New),
    /// Learn thresholds, a map or floor colors.
    #[command(subcommand)]
    Learn(learn::Learn),
    /// Calibrate a camera: its lens, its mount and its latency; or write the checkerboard for it.
    #[command(subcommand)]
    Calibrate(calibrate::Calibrate),
    /// Write a report on a recording: one HTML file with path, control, halts and latencies.
    Report(report::Arguments),
    /// Explain what a running robot does, or did in a recording, and why.
    Why(why::Arguments),
    /// Show a running robot or a recording in the browser.
    #[cfg(feature = "view")]
    View(view::Arguments),
    /// Show a running robot or a recording in the browser (not in this build).
    #[cfg(not(feature = "view"))]
    View(view_missing::Arguments),
    /// Show a running robot in the terminal.
    #[cfg(feature = "view")]
    Top(top::Arguments),
    /// Show a running robot in the terminal (not in this build).
    #[cfg(not(feature = "view"))]
    Top(view_missing::Arguments),
    /// List the plugins of a running robot and their state.
    Ps(ps::Arguments),
    /// List, print and measure the topics of a running robot.
    #[command(subcommand)]
    Topic(topic::Topic),
    /// Send a running robot to a goal and wait until it arrives.
    Goto(goto::Arguments),
    /// Change parameters of running behaviors: all of them, or none if one is refused.
    Set(set::Arguments),
    /// Enable a behavior of a running robot.
    Enable(switch::Arguments),
    /// Disable a behavior of a running robot: its proposals are ignored.
    Disable(switch::Arguments),
    /// Drive a running robot with the keyboard or a joystick.
    Teleop(teleop::Arguments),
    /// Stop a running robot at once; it stays stopped until `reset`.
    Estop(estop::Arguments),
    /// Release the emergency stop of a running robot.
    Reset(estop::Arguments),
    /// List the topics of an MCAP file, and the facts of its run.
    Info(info::Arguments),
    /// Print a task that does what a configuration of twist_mux (ROS 2) does.
    Import(import::Arguments),
    /// Run a recording again, and compare every proposal and decision to the byte.
    Replay(replay::Arguments),
    /// Give a recording whose run was killed an index and an end.
    Repair(repair::Arguments),
    /// Run one plugin of a running robot; started by its supervisor.
    #[command(hide = true)]
    Plugin(plugin::Arguments),
}

impl Command {
    /// Runs the command.
    pub fn run(self, print: Print) -> CommandResult {
        match self {
            Command::Run(arguments) => run::run(&arguments, print),
            Command::Check(arguments) => check::check(&arguments, print),
            Command::Graph(arguments) => graph::graph(&arguments, print),
            Command::List => list::list(print),
            Command::Describe(arguments) => describe::describe(&arguments, print),
            Command::Schema(arguments) => schema::schema(&arguments),
            Command::New(new) => new::new(&new, print),
            Command::Learn(learn) => learn::learn(&learn, print),
            Command::Calibrate(calibrate) => calibrate::calibrate(&calibrate, print),
            Command::Report(arguments) => report::report(&arguments, print),
            Command::Why(arguments) => why::why(&arguments, print),
            #[cfg(feature = "view")]
            Command::View(arguments) => view::view(&arguments, print),
            #[cfg(feature = "view")]
            Command::Top(arguments) => top::top(&arguments),
            #[cfg(not(feature = "view"))]
            Command::View(_) | Command::Top(_) => Err(view_missing::failure()),
            Command::Ps(arguments) => ps::ps(&arguments, print),
            Command::Topic(topic) => topic::topic(&topic, print),
            Command::Goto(arguments) => goto::goto(&arguments, print),
            Command::Set(arguments) => set::set(&arguments, print),
            Command::Enable(arguments) => switch::enable(&arguments, print),
            Command::Disable(arguments) => switch::disable(&arguments, print),
            Command::Teleop(arguments) => teleop::teleop(&arguments),
            Command::Estop(arguments) => estop::estop(&arguments, print),
            Command::Reset(arguments) => estop::reset(&arguments, print),
            Command::Info(arguments) => info::info(&arguments, print),
            Command::Import(arguments) => import::import(&arguments, print),
            Command::Replay(arguments) => replay::replay(&arguments, print),
            Command::Repair(arguments) => repair::repair(&arguments, print),
            Command::Plugin(arguments) => plugin::plugin(&arguments),
        }
    }
}
