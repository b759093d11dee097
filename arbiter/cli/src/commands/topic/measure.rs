//! `yamabico topic hz` and `yamabico topic latency`: the rate of messages and the age of their data.

use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::json;
use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_runtime::client::{ReceivedMessage, RollingWindow, Statistics};
use yamabico_runtime::record::Tap;

use super::recording::{self, RecordingArgument};
use super::{INTERRUPT_CHECK, WAITING, subscribe};
use crate::output::{CommandResult, DONE, Failure, Print, complain, printable};
use crate::robot_argument::RobotArgument;

/// Arguments of `topic hz` and `topic latency`.
#[derive(Args)]
pub struct Arguments {
    /// Topic, as `yamabico topic list` prints it.
    topic: String,
    /// Number of newest messages that the statistics are computed from.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    window: u32,
    /// Duration of the measurement, s; by default until Ctrl-C.
    #[arg(long = "for", value_name = "S")]
    seconds: Option<f64>,
    /// Time between two printed lines, s.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    every: f64,
    #[command(flatten)]
    robot: RobotArgument,
}

/// Arguments of `topic hz`.
#[derive(Args)]
pub struct RateArguments {
    #[command(flatten)]
    file: RecordingArgument,
    #[command(flatten)]
    measurement: Arguments,
}

/// Measures the rate of the messages.
pub fn hz(arguments: &RateArguments, print: Print) -> CommandResult {
    let RateArguments { file, measurement: arguments } = arguments;
    let line = move |statistics: &Statistics, lost| match print {
        Print::Json => {
            json!({ "rate_hz": 1.0 / statistics.mean, "interval_s": statistics, "lost": lost }).to_string()
        }
        Print::Text => format!(
            "{:8.2} Hz   interval min {} max {} std dev {}   window {}{}",
            1.0 / statistics.mean,
            duration_text(statistics.min),
            duration_text(statistics.max),
            duration_text(statistics.std_dev),
            statistics.count,
            lost_text(lost),
        ),
    };
    if let Some(file) = &file.recording {
        return recorded_rate(file, arguments, &line);
    }
    let mut last: Option<Time> = None;
    let interval_s = move |received: &ReceivedMessage<'_>, _: (Time, Time)| {
        let before = last.replace(received.at);
        before.map(|before| received.at.since(before).as_secs_f64())
    };
    measure(arguments, interval_s, print, &line)
}

/// Prints the rate of a topic of a recording, over its last messages.
fn recorded_rate(
    file: &Path,
    arguments: &Arguments,
    line: &dyn Fn(&Statistics, u64) -> String,
) -> CommandResult {
    recording::check(file, &arguments.topic)?;
    let window = RollingWindow::new(arguments.window as usize);
    let mut intervals = Intervals { window, last: None, lost: 0 };
    recording::read(file, &arguments.topic, &mut intervals)?;
    let Some(statistics) = intervals.window.statistics() else {
        return Err(Failure::not_done(format!("too few messages on `{}` to measure", arguments.topic)));
    };
    // A closed pipe ends the program elsewhere.
    let _ = writeln!(std::io::stdout(), "{}", line(&statistics, intervals.lost));
    Ok(DONE)
}

/// Times between the messages of a recording.
struct Intervals {
    window: RollingWindow,
    /// Time and number of the last message.
    last: Option<(Time, u64)>,
    lost: u64,
}

impl Tap for Intervals {
    fn message(&mut self, _: &str, message: &MessageType, time: Time, header: &[u8], _: &[u8]) {
        let number = (message.sequence)(header);
        if let Some((before, last)) = self.last.replace((time, number)) {
            self.window.add(time.seconds_after(before));
            self.lost += number.saturating_sub(last + 1);
        }
    }
}

/// Measures the age of the data in the messages on arrival.
pub fn latency(arguments: &Arguments, print: Print) -> CommandResult {
    let age_s = |received: &ReceivedMessage<'_>, (_, evidence): (Time, Time)| {
        Some(received.now.seconds_after(evidence))
    };
    measure(arguments, age_s, print, &|statistics, lost| match print {
        Print::Json => json!({ "age_s": statistics, "lost": lost }).to_string(),
        Print::Text => format!(
            "age of the data   p50 {} p99 {} max {}   window {}{}",
            duration_text(statistics.p50),
            duration_text(statistics.p99),
            duration_text(statistics.max),
            statistics.count,
            lost_text(lost),
        ),
    })
}

/// Computes a number from each message and its two stamps, and prints statistics of these numbers from time to time.
fn measure(
    arguments: &Arguments,
    mut number_of: impl FnMut(&ReceivedMessage<'_>, (Time, Time)) -> Option<f64>,
    print: Print,
    line: &dyn Fn(&Statistics, u64) -> String,
) -> CommandResult {
    let (mut subscriber, interrupt) = subscribe(&arguments.robot, &arguments.topic)?;
    let stamps = subscriber.message().stamps;
    let mut window = RollingWindow::new(arguments.window as usize);
    let duration = arguments.seconds.map_or(Duration::MAX, seconds);
    let every = seconds(arguments.every);
    let (began, mut printed, mut has_news) = (Instant::now(), Instant::now(), false);
    let mut is_informed = print == Print::Json;
    let mut is_over = false;
    while !is_over && !interrupt.load(Ordering::Relaxed) {
        let result = subscriber.receive(INTERRUPT_CHECK.min(every), &mut |received| {
            if let Some(number) = number_of(&received, stamps(received.sample.header())) {
                window.add(number);
                has_news = true;
            }
            ControlFlow::Continue(())
        });
        if result?.is_break() {
            break;
        }
        is_over = began.elapsed() >= duration;
        if printed.elapsed() >= every || is_over {
            printed = Instant::now();
            if let Some(statistics) = window.statistics().filter(|_| std::mem::take(&mut has_news))
                && writeln!(std::io::stdout(), "{}", line(&statistics, subscriber.lost())).is_err()
            {
                break;
            }
        }
        if !is_informed && window.statistics().is_none() && began.elapsed() > WAITING {
            is_informed = true;
            complain(&format!(
                "waiting for messages on {}; press Ctrl-C to end",
                printable(&arguments.topic)
            ));
        }
    }
    if window.statistics().is_none() {
        return Err(Failure::not_done(format!("too few messages on `{}` to measure", arguments.topic)));
    }
    Ok(DONE)
}

fn lost_text(lost: u64) -> String {
    if lost == 0 { String::new() } else { format!("   {lost} lost") }
}

fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

/// A duration with a unit.
fn duration_text(seconds: f64) -> String {
    match seconds.abs() {
        small if small < 1e-3 => format!("{:.1} us", seconds * 1e6),
        medium if medium < 1.0 => format!("{:.2} ms", seconds * 1e3),
        _ => format!("{seconds:.3} s"),
    }
}
