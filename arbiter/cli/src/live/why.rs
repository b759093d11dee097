//! `yamabico why`: what a running robot does, in words, and why.

use std::io::Write;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use yamabico_arbiter::decide::{Explanation, Told, explain};
use yamabico_core::message::{Axes, Mode, Name};
use yamabico_runtime::operator::{LookError, Lookout};

use super::which::Which;
use crate::commands::run::interrupt_flag;
use crate::output::{BAD_CONFIGURATION, DEVICE_FAILED, DONE, NOT_ARRIVED, Print, exit, fail};

/// How long behaviors may take to say what they say anyway.
const LOOK: Duration = Duration::from_millis(500);
/// With `--follow`, no more often than this.
const PACE: Duration = Duration::from_millis(200);

/// What `why` is told.
#[derive(Args)]
pub struct Arguments {
    /// Tell again whenever something else is decided, until Ctrl-C.
    #[arg(long, short)]
    follow: bool,
    #[command(flatten)]
    robot: Which,
}

/// Tells why the robot does what it does.
pub fn why(arguments: &Arguments, print: Print) -> ExitCode {
    let robot = match arguments.robot.choose() {
        Ok(robot) => robot,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    let flag = match interrupt_flag() {
        Ok(flag) => flag,
        Err(error) => return fail(&format!("cannot listen for Ctrl-C: {error}"), DEVICE_FAILED),
    };
    let seen = Lookout::join(&robot).and_then(|mut lookout| {
        let told = lookout.look_around(LOOK)?;
        Ok((lookout, told))
    });
    let (mut lookout, told) = match seen {
        Ok(seen) => seen,
        Err(error @ LookError::Bus(_)) => return fail(&error.to_string(), BAD_CONFIGURATION),
        Err(error) => return fail(&error.to_string(), NOT_ARRIVED),
    };
    if !arguments.follow {
        print.show(&as_json(&robot, &told, &explain(&told, lookout.scene())), |_| {
            format!("{robot}: {}", explain(&told, lookout.scene()))
        });
        return exit(DONE);
    }
    match follow(&mut lookout, &robot, told, print, &flag) {
        Ok(()) => exit(DONE),
        Err(error) => fail(&error.to_string(), NOT_ARRIVED),
    }
}

/// Tells again whenever the plot changes.
fn follow(
    lookout: &mut Lookout,
    robot: &str,
    mut told: Told,
    print: Print,
    flag: &AtomicBool,
) -> Result<(), LookError> {
    let began = Instant::now();
    let mut last: Option<(Plot, Instant)> = None;
    while !flag.load(Ordering::Relaxed) {
        let plot = Plot::of(&told);
        let is_news = last.as_ref().is_none_or(|(before, at)| *before != plot && at.elapsed() >= PACE);
        if is_news {
            let explanation = explain(&told, lookout.scene());
            let text = match print {
                Print::Json => as_json(robot, &told, &explanation).to_string(),
                Print::Text => format!("[{:8.2} s] {robot}: {explanation}", began.elapsed().as_secs_f64()),
            };
            if writeln!(std::io::stdout(), "{text}").is_err() {
                return Ok(());
            }
            last = Some((plot, Instant::now()));
        }
        told = lookout.look(Duration::from_secs(3))?.ok_or(LookError::NoDecision)?;
    }
    Ok(())
}

/// What makes two decisions the same story: everything but numbers that change all the time.
#[derive(PartialEq)]
struct Plot {
    mode: Option<Mode>,
    halted: Axes,
    actors: [Name; 9],
    verdicts: Vec<(u32, Name, u32)>,
}

impl Plot {
    fn of(told: &Told) -> Plot {
        let header = &told.header;
        let mut actors = [Name::default(); 9];
        let names = [header.source, header.limiter, header.halter].into_iter().flatten();
        actors.iter_mut().zip(names).for_each(|(actor, name)| *actor = name);
        let verdicts = told.verdicts.iter().map(|verdict| (verdict.outcome, verdict.by, verdict.reason));
        Plot { mode: header.mode(), halted: header.halted, actors, verdicts: verdicts.collect() }
    }
}

fn as_json(robot: &str, told: &Told, explanation: &Explanation) -> Value {
    json!({
        "robot": robot,
        "mode": told.header.mode().map(Mode::as_str),
        "explanation": explanation,
        "decision": told.header,
        "verdicts": told.verdicts,
    })
}
