//! `yamabico why`: the decisions of a running robot or of a recording, explained.

mod recording;

use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use yamabico_arbiter::decide::{DecisionMessage, Explanation, explain};
use yamabico_core::message::{Axes, Mode, Name};
use yamabico_runtime::client::{ClientError, RobotClient};

use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, DONE, Print, printable};
use crate::robot_argument::RobotArgument;

/// Time for the newest proposals and process states to arrive.
const COLLECTING: Duration = Duration::from_millis(500);
/// With `--follow`, minimum time between two explanations.
const MIN_INTERVAL: Duration = Duration::from_millis(200);
/// With `--follow`, maximum time between two decisions.
const TIMEOUT: Duration = Duration::from_secs(3);

/// Arguments of `why`.
#[derive(Args)]
pub struct Arguments {
    /// Recording; by default a running robot.
    #[arg(value_name = "FILE.mcap", conflicts_with_all = ["robot", "follow"])]
    recording: Option<PathBuf>,
    /// Time of the decision in the recording, s; by default its end.
    #[arg(long, value_name = "S", requires = "recording")]
    at: Option<f64>,
    /// Explain every decision of the recording that differs from the one before in more than its numbers.
    #[arg(long, requires = "recording", conflicts_with = "at")]
    every_change: bool,
    /// Explain again whenever the decision changes, until Ctrl-C.
    #[arg(long, short)]
    follow: bool,
    #[command(flatten)]
    robot: RobotArgument,
}

/// Explains the newest decision, or those of a recording.
pub fn why(arguments: &Arguments, print: Print) -> CommandResult {
    match &arguments.recording {
        Some(file) if arguments.every_change => return recording::explain_every_change(file, print),
        Some(file) => return recording::explain_at(file, arguments.at, print),
        None => {}
    }
    let robot = arguments.robot.choose()?;
    let interrupt = interrupt_flag()?;
    let mut client = RobotClient::join(&robot)?;
    let decision = client.decision_in_context(COLLECTING)?;
    if arguments.follow {
        follow(&mut client, &robot, decision, print, &interrupt)?;
    } else {
        let explanation = explain(&decision, &client.context());
        print.show(&json(&robot, &decision, &explanation), |_| format!("{robot}: {explanation}"));
    }
    Ok(DONE)
}

/// Explains `decision`, and every later one that differs in more than its numbers.
fn follow(
    client: &mut RobotClient,
    robot: &str,
    mut decision: DecisionMessage,
    print: Print,
    interrupt: &AtomicBool,
) -> Result<(), ClientError> {
    let began = Instant::now();
    let mut last: Option<(Gist, Instant)> = None;
    while !interrupt.load(Ordering::Relaxed) {
        let gist = Gist::new(&decision);
        let is_news =
            last.as_ref().is_none_or(|(before, at)| *before != gist && at.elapsed() >= MIN_INTERVAL);
        if is_news {
            let explanation = explain(&decision, &client.context());
            let text = match print {
                Print::Json => json(robot, &decision, &explanation).to_string(),
                Print::Text => format!("[{:8.2} s] {robot}: {explanation}", began.elapsed().as_secs_f64()),
            };
            if writeln!(std::io::stdout(), "{}", printable(&text)).is_err() {
                return Ok(());
            }
            last = Some((gist, Instant::now()));
        }
        decision = client.latest_decision(TIMEOUT)?.ok_or(ClientError::NoDecision)?;
    }
    Ok(())
}

/// A decision without the numbers that change all the time.
#[derive(PartialEq)]
struct Gist {
    mode: Option<Mode>,
    halted: Axes,
    authors: [Name; 9],
    verdicts: Vec<(u32, Name, u32)>,
}

impl Gist {
    fn new(decision: &DecisionMessage) -> Gist {
        let header = &decision.header;
        let mut authors = [Name::default(); 9];
        let names = [header.source, header.limiter, header.halter].into_iter().flatten();
        authors.iter_mut().zip(names).for_each(|(author, name)| *author = name);
        let verdicts = decision.verdicts.iter().map(|verdict| (verdict.outcome, verdict.by, verdict.reason));
        Gist { mode: header.mode(), halted: header.halted, authors, verdicts: verdicts.collect() }
    }
}

fn json(robot: &str, decision: &DecisionMessage, explanation: &Explanation) -> Value {
    json!({
        "robot": robot,
        "mode": decision.header.mode().map(Mode::as_str),
        "explanation": explanation,
        "decision": decision.header,
        "verdicts": decision.verdicts,
    })
}
