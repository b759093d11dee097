//! `yamabico topic hz` and `yamabico topic latency`: how often messages arrive, and how old they are.

use std::io::Write;
use std::ops::ControlFlow;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::json;
use yamabico_core::time::Time;
use yamabico_runtime::operator::{Figures, Heard, Window};

use super::super::which::Which;
use super::{NAP, WAITING, listen};
use crate::output::{DONE, NOT_ARRIVED, Print, exit, fail};

/// What `topic hz` and `topic latency` are told.
#[derive(Args)]
pub struct Arguments {
    /// The topic.
    topic: String,
    /// Messages that a figure is made of.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    window: u32,
    /// End after so many seconds; without it, with Ctrl-C.
    #[arg(long = "for", value_name = "S")]
    seconds: Option<f64>,
    /// From one line to the next, seconds.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    every: f64,
    #[command(flatten)]
    robot: Which,
}

/// Measures how often messages arrive.
pub fn hz(arguments: &Arguments, print: Print) -> ExitCode {
    let mut last: Option<Time> = None;
    let interval_s = move |heard: &Heard<'_>, _: (Time, Time)| {
        let before = last.replace(heard.at);
        before.map(|before| heard.at.since(before).as_secs_f64())
    };
    measure(arguments, interval_s, print, &|figures, lost| match print {
        Print::Json => {
            json!({ "rate_hz": 1.0 / figures.mean, "interval_s": figures, "lost": lost }).to_string()
        }
        Print::Text => format!(
            "{:8.2} Hz   interval min {} max {} std dev {}   window {}{}",
            1.0 / figures.mean,
            span(figures.min),
            span(figures.max),
            span(figures.std_dev),
            figures.count,
            lost_in_words(lost),
        ),
    })
}

/// Measures how old messages are on arrival.
pub fn latency(arguments: &Arguments, print: Print) -> ExitCode {
    let age_s = |heard: &Heard<'_>, (_, evidence): (Time, Time)| Some(heard.now.seconds_after(evidence));
    measure(arguments, age_s, print, &|figures, lost| match print {
        Print::Json => json!({ "age_s": figures, "lost": lost }).to_string(),
        Print::Text => format!(
            "age of its data   p50 {} p99 {} max {}   window {}{}",
            span(figures.p50),
            span(figures.p99),
            span(figures.max),
            figures.count,
            lost_in_words(lost),
        ),
    })
}

/// Takes a number of each message, given it and its two stamps, and prints a line now and then.
fn measure(
    arguments: &Arguments,
    mut number_of: impl FnMut(&Heard<'_>, (Time, Time)) -> Option<f64>,
    print: Print,
    line: &dyn Fn(&Figures, u64) -> String,
) -> ExitCode {
    let (mut listener, flag) = match listen(&arguments.robot, &arguments.topic) {
        Ok(listening) => listening,
        Err(code) => return code,
    };
    let stamps = listener.message().stamps;
    let mut window = Window::new(arguments.window as usize);
    let longest = arguments.seconds.map_or(Duration::MAX, seconds);
    let every = seconds(arguments.every);
    let (began, mut printed, mut has_news) = (Instant::now(), Instant::now(), false);
    let mut is_told = print == Print::Json;
    let mut is_over = false;
    while !is_over && !flag.load(Ordering::Relaxed) {
        let heard = listener.hear(NAP.min(every), &mut |heard| {
            if let Some(number) = number_of(&heard, stamps(heard.sample.header())) {
                window.add(number);
                has_news = true;
            }
            ControlFlow::Continue(())
        });
        if let Err(error) = heard {
            return fail(&error.to_string(), NOT_ARRIVED);
        }
        is_over = began.elapsed() >= longest;
        if printed.elapsed() >= every || is_over {
            printed = Instant::now();
            if let Some(figures) = window.figures().filter(|_| std::mem::take(&mut has_news))
                && writeln!(std::io::stdout(), "{}", line(&figures, listener.lost())).is_err()
            {
                break;
            }
        }
        if !is_told && window.figures().is_none() && began.elapsed() > WAITING {
            is_told = true;
            eprintln!("waiting for messages on {} (Ctrl-C ends it)", arguments.topic);
        }
    }
    if window.figures().is_none() {
        return fail(&format!("too few messages on `{}` to measure", arguments.topic), NOT_ARRIVED);
    }
    exit(DONE)
}

fn lost_in_words(lost: u64) -> String {
    if lost == 0 { String::new() } else { format!("   {lost} lost") }
}

fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

/// Seconds for people.
fn span(seconds: f64) -> String {
    match seconds.abs() {
        small if small < 1e-3 => format!("{:.1} us", seconds * 1e6),
        medium if medium < 1.0 => format!("{:.2} ms", seconds * 1e3),
        _ => format!("{seconds:.3} s"),
    }
}
