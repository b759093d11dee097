//! `yamabico topic`: the topics of a running robot or of a recording.

mod echo;
mod list;
mod measure;
mod recording;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Subcommand;
use yamabico_runtime::client::{RobotClient, TopicSubscriber};

use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, Failure, Print};
use crate::robot_argument::RobotArgument;

/// Maximum time between two checks for Ctrl-C.
const INTERRUPT_CHECK: Duration = Duration::from_millis(100);
/// Time without a message after which the user is informed.
const WAITING: Duration = Duration::from_secs(2);

/// The operation on topics.
#[derive(Subcommand)]
pub enum Topic {
    /// List topics: message, buffering and publisher.
    List(list::Arguments),
    /// Print the messages of a topic.
    Echo(echo::Arguments),
    /// Measure the rate of the messages of a topic.
    Hz(measure::RateArguments),
    /// Measure the age of the data in the messages of a topic on arrival, since the sensor's measurement.
    Latency(measure::Arguments),
}

/// Lists, prints or measures.
pub fn topic(topic: &Topic, print: Print) -> CommandResult {
    match topic {
        Topic::List(arguments) => list::list(arguments, print),
        Topic::Echo(arguments) => echo::echo(arguments, print),
        Topic::Hz(arguments) => measure::hz(arguments, print),
        Topic::Latency(arguments) => measure::latency(arguments, print),
    }
}

/// Subscribes to `topic` of the chosen robot; also returns the flag that Ctrl-C sets.
fn subscribe(robot: &RobotArgument, topic: &str) -> Result<(TopicSubscriber, Arc<AtomicBool>), Failure> {
    let robot = robot.choose()?;
    let interrupt = interrupt_flag()?;
    Ok((RobotClient::join(&robot)?.subscribe(topic)?, interrupt))
}
