//! `yamabico view`: a running robot or a recording in the browser.

use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::Args;
use serde_json::json;
use yamabico_host::Scheduling;
use yamabico_view::live::LiveRobot;
use yamabico_view::recording::{Player, Recording};
use yamabico_view::server::{DEFAULT_PORT, FoxglovePort, Server, ServerSettings, Source};

use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, DONE, Failure, Print, complain};
use crate::robot_argument::RobotArgument;

/// Time between two looks for Ctrl-C.
const INTERRUPT_CHECK: Duration = Duration::from_millis(100);

/// Arguments of `view`.
#[derive(Args)]
pub struct Arguments {
    /// Name of a running robot, or a recording; by default the only running robot.
    #[arg(value_name = "ROBOT|FILE.mcap")]
    source: Option<String>,
    /// Address of this machine at which other machines may look; commands then need the token in the printed address.
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<IpAddr>,
    /// Port; 0 takes a free one.
    #[arg(long, value_name = "PORT", default_value_t = DEFAULT_PORT)]
    port: u16,
    /// Port for Foxglove and Lichtblick, 0 for a free one [default: 8765, unless it is taken].
    #[arg(long, value_name = "PORT")]
    foxglove: Option<u16>,
    /// Do not serve Foxglove and Lichtblick.
    #[arg(long, conflicts_with = "foxglove")]
    no_foxglove: bool,
    /// Site whose page may connect like Foxglove, such as http://lichtblick.lan; may be repeated.
    #[arg(long, value_name = "SITE")]
    viewer: Vec<String>,
}

/// Serves the page until Ctrl-C.
pub fn view(arguments: &Arguments, print: Print) -> CommandResult {
    let interrupt = interrupt_flag()?;
    for refused in Scheduling::BACKGROUND.apply() {
        complain(&refused.to_string());
    }
    let (source, what) = match arguments.source.as_deref() {
        Some(file) if is_recording(file) => (open(Path::new(file))?, file.to_owned()),
        name => {
            let robot = RobotArgument::named(name.map(str::to_owned)).choose()?;
            (Source::Robot(Box::new(LiveRobot::join(&robot)?)), format!("robot {robot}"))
        }
    };
    let foxglove = match arguments.foxglove {
        _ if arguments.no_foxglove => FoxglovePort::Off,
        Some(port) => FoxglovePort::At(port),
        None => FoxglovePort::IfFree,
    };
    let settings = ServerSettings {
        listen: arguments.listen,
        port: arguments.port,
        folder: PathBuf::from("."),
        foxglove,
        viewers: arguments.viewer.clone(),
    };
    let server = Server::start(source, &settings).map_err(Failure::device)?;
    let answer = json!({ "url": server.url(), "foxglove": server.foxglove_url(), "token": server.token() });
    print.show(&answer, |_| {
        let who = match server.token() {
            Some(_) => "other machines may look; only this address may command, keep it to yourself",
            None => "only this machine may look",
        };
        let foxglove =
            server.foxglove_url().map_or(String::new(), |url| format!("; Foxglove, Lichtblick: {url}"));
        format!("{what}: {}{foxglove} ({who}); press Ctrl-C to end", server.url())
    });
    while !interrupt.load(Ordering::Relaxed) {
        std::thread::sleep(INTERRUPT_CHECK);
    }
    Ok(DONE)
}

fn is_recording(source: &str) -> bool {
    source.ends_with(".mcap") || Path::new(source).is_file()
}

fn open(file: &Path) -> Result<Source, Failure> {
    let recording = Recording::open(file).map_err(Failure::device)?;
    if let Some(cause) = recording.broken_off() {
        complain(&format!("{}: {cause}; showing the rest", file.display()));
    }
    Ok(Source::Recording(Box::new(Player::new(recording).map_err(Failure::device)?)))
}
