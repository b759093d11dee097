//! `yamabico info`: the contents of an MCAP file.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use yamabico_runtime::record::{Info, info as read_info};

use crate::output::{CommandResult, DONE, Failure, Print, table};

/// Arguments of `info`.
#[derive(Args)]
pub struct Arguments {
    /// Recording, or another MCAP file.
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
}

/// Lists topics with their types, rates and gaps, and the facts of the run.
pub fn info(arguments: &Arguments, print: Print) -> CommandResult {
    print.show(&read_info(&arguments.file).map_err(Failure::usage)?, text);
    Ok(DONE)
}

fn text(info: &Info) -> String {
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
