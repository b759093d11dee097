//! `yamabico topic list`: the topics of a running robot.

use std::process::ExitCode;

use clap::Args;
use yamabico_core::message::{Channel, MessageType};
use yamabico_host::bus::Bus;
use yamabico_runtime::execution::{Posted, Roster};
use yamabico_runtime::operator::LookError;

use super::super::which::Which;
use crate::output::{BAD_CONFIGURATION, DONE, Print, exit, fail, table};

/// What `topic list` is told.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    robot: Which,
}

/// Lists the topics.
pub fn list(arguments: &Arguments, print: Print) -> ExitCode {
    let robot = match arguments.robot.choose() {
        Ok(robot) => robot,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    let roster = Bus::join(&robot).map_err(LookError::from).and_then(|bus| Roster::of_robot(&bus));
    match roster {
        Ok(mut roster) => {
            roster.topics.sort_by(|a, b| a.name.cmp(&b.name));
            print.show(&roster.topics, |topics| in_words(topics));
            exit(DONE)
        }
        Err(error) => fail(&error.to_string(), BAD_CONFIGURATION),
    }
}

fn in_words(topics: &[Posted]) -> String {
    let mut table = table(&["topic", "message", "kept", "published by"], 0..0);
    for topic in topics {
        let kept = MessageType::find(&topic.message).map_or("", |message| match message.channel {
            Channel::Latest => "the newest",
            Channel::Stream => "every one",
        });
        table.add_row([&topic.name, &topic.message, kept, &topic.by]);
    }
    table.to_string()
}
