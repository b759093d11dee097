//! `yamabico info`: the contents of a recording, and a robot file with its sensors.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use yamabico_recording::ros2::transforms::Frames;
use yamabico_recording::storage::{self, Messages};
use yamabico_runtime::record::{Info, InfoCounter, info as read_info};

use crate::output::{CommandResult, DONE, Failure, Print, table};

/// Arguments of `info`.
#[derive(Args)]
pub struct Arguments {
    /// Recording of this program or of ROS 2: an MCAP file, or a folder of rosbag2.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Prints a robot file with the sensors of the recording, to begin with.
    #[arg(long)]
    robot_toml: bool,
}

/// Lists topics with their types, rates and gaps, the frames, and the facts of the run.
pub fn info(arguments: &Arguments, print: Print) -> CommandResult {
    let file = &arguments.file;
    let refused = |error: String| Failure::usage(format!("{}: {error}", file.display()));
    if arguments.robot_toml {
        let text = yamabico_recording::robot_file::robot_file(file).map_err(refused)?;
        print.show(&text, |text| text.trim_end().to_owned());
        return Ok(DONE);
    }
    let info = match storage::is_mcap(file) {
        true => read_info(file).map_err(Failure::usage)?,
        false => counted(file).map_err(refused)?,
    };
    let frames = Frames::of(file).unwrap_or_default();
    print.show(&info, |info| text(info, &frames));
    Ok(DONE)
}

/// Contents of a recording that is not one MCAP file.
fn counted(path: &Path) -> Result<Info, String> {
    let mut counter = InfoCounter::new(path, storage::bytes(path));
    for message in Messages::open(path)? {
        match message {
            Ok(message) => {
                let topic = &message.topic;
                let (time, bytes) = (message.log_time, message.data.len());
                counter.add(&topic.name, &topic.message_type, &topic.encoding, time, bytes);
            }
            Err(error) => counter.break_off(error)?,
        }
    }
    Ok(counter.finish())
}

fn text(info: &Info, frames: &Frames) -> String {
    let head = ["topic", "type", "encoding", "messages", "rate", "largest gap", "kB"];
    let mut topics = table(&head, 3..7);
    for (name, topic) in &info.topics {
        topics.add_row([
            name.clone(),
            topic.message_type.clone(),
            topic.encoding.clone(),
            topic.messages.to_string(),
            topic.rate_hz.map_or("-".into(), |rate| format!("{rate:.1} Hz")),
            format!("{:.2} s", topic.largest_gap_s),
            (topic.bytes / 1000).to_string(),
        ]);
    }
    let mut text = format!("{topics}\n");
    for (child, parent) in frames.names() {
        let _ = writeln!(text, "frame: {child} on {parent}");
    }
    for (key, fact) in &info.facts {
        let _ = writeln!(text, "{key}: {}", fact.trim());
    }
    for (name, bytes) in &info.files {
        let _ = writeln!(text, "attached: {name} ({bytes} bytes)");
    }
    for (name, topic) in info.topics.iter().filter(|(_, topic)| topic.steps_back > 0) {
        let _ = writeln!(text, "note: on {name} the time goes back {} times", topic.steps_back);
    }
    if let Some(cause) = &info.broken_off {
        let _ = writeln!(text, "note: the file breaks off: {cause}; `yamabico repair` gives it an end");
    }
    let Info { path, messages, seconds, bytes, .. } = info;
    let megabytes = *bytes as f64 * 1e-6;
    let _ = write!(text, "{}: {messages} messages over {seconds:.1} s, {megabytes:.1} MB", path.display());
    text
}
