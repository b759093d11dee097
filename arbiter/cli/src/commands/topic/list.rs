//! `yamabico topic list`: every topic of a running robot or of a recording.

use clap::Args;
use yamabico_core::message::{Channel, MessageType};
use yamabico_runtime::client::RobotClient;
use yamabico_runtime::execution::TopicEntry;

use super::recording::{self, RecordingArgument};
use crate::output::{CommandResult, DONE, Print, table};
use crate::robot_argument::RobotArgument;

/// Arguments of `topic list`.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    file: RecordingArgument,
    #[command(flatten)]
    robot: RobotArgument,
}

/// Lists the topics.
pub fn list(arguments: &Arguments, print: Print) -> CommandResult {
    if let Some(file) = &arguments.file.recording {
        return recording::list(file, print);
    }
    let robot = arguments.robot.choose()?;
    let mut topics = RobotClient::join(&robot)?.manifest()?.topics.clone();
    topics.sort_by(|a, b| a.name.cmp(&b.name));
    print.show(&topics, |topics| text(topics));
    Ok(DONE)
}

fn text(topics: &[TopicEntry]) -> String {
    let mut table = table(&["topic", "message", "buffer", "publisher"], 0..0);
    for topic in topics {
        let buffer = MessageType::find(&topic.message).map_or("", |message| match message.channel {
            Channel::Latest => "newest message",
            Channel::Stream => "every message",
        });
        table.add_row([&topic.name, &topic.message, buffer, &topic.publisher]);
    }
    table.to_string()
}
