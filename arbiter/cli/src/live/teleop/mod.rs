//! `yamabico teleop`: drives a running robot by the keys of the terminal, or by a joystick.

#[cfg(feature = "joystick")]
mod joystick;
mod keys;
mod screen;

use std::io::IsTerminal;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use crossterm::event::{Event, poll, read};
use yamabico_arbiter::decide::explain;
use yamabico_core::message::Stick;
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, Publisher};
use yamabico_runtime::execution::topics;
use yamabico_runtime::operator::{Desk, LookError, Lookout, Request};

use super::which::Which;
use crate::commands::run::interrupt_flag;
use crate::output::{BAD_CONFIGURATION, DEVICE_FAILED, DONE, NOT_ARRIVED, Print, exit, fail};
use keys::{Hand, Wish, wish};
use screen::Screen;

/// From one message about the stick to the next while it is held.
const PERIOD: Duration = Duration::from_millis(50);
/// Behavior that obeys a stick.
const PLUGIN: &str = "teleop";
const HELP: &str = "arrows or i , j l: drive while held   u o m .: arcs   J L: sideways   k: stand   + -: speed   space: emergency stop   q: end";

/// What `teleop` is told.
#[derive(Args)]
pub struct Arguments {
    /// A joystick instead of keys: it drives while its left upper trigger is held.
    #[cfg(feature = "joystick")]
    #[arg(long)]
    joystick: bool,
    #[command(flatten)]
    robot: Which,
}

/// Drives until `q`, Ctrl-C, or the robot's end.
pub fn teleop(arguments: &Arguments, _: Print) -> ExitCode {
    let robot = match arguments.robot.choose() {
        Ok(robot) => robot,
        Err(problem) => return fail(&problem, BAD_CONFIGURATION),
    };
    let opened = Lookout::join(&robot).and_then(|lookout| {
        let stick = Bus::join(&robot)?.publisher::<Stick>(topics::STICK)?;
        Ok((lookout, stick))
    });
    let (lookout, stick) = match opened {
        Ok(opened) => opened,
        Err(error @ LookError::Bus(_)) => return fail(&error.to_string(), BAD_CONFIGURATION),
        Err(error) => return fail(&error.to_string(), NOT_ARRIVED),
    };
    if !lookout.roster().plugins.iter().any(|plugin| plugin.plugin == PLUGIN) {
        let problem = format!(
            "robot `{robot}` has no behavior that obeys a stick: add `[behaviors.{PLUGIN}]` with `inputs = {{ stick = \
             \"operator\" }}` to its task, as configs/teleop.toml has it"
        );
        return fail(&problem, BAD_CONFIGURATION);
    }
    #[cfg(feature = "joystick")]
    let by_joystick = arguments.joystick;
    #[cfg(not(feature = "joystick"))]
    let by_joystick = false;
    if !by_joystick && !std::io::stdin().is_terminal() {
        return fail("keys are read from a terminal, and standard input is none", BAD_CONFIGURATION);
    }
    let flag = match interrupt_flag() {
        Ok(flag) => flag,
        Err(error) => return fail(&format!("cannot listen for Ctrl-C: {error}"), DEVICE_FAILED),
    };
    let mut session = Session { robot, lookout, stick, sequence: 0, was_held: false };
    #[cfg(feature = "joystick")]
    let outcome = if by_joystick { session.by_joystick(&flag) } else { session.by_keys(&flag) };
    #[cfg(not(feature = "joystick"))]
    let outcome = session.by_keys(&flag);
    match outcome {
        Ok(()) => exit(DONE),
        Err(problem) => fail(&problem, NOT_ARRIVED),
    }
}

/// A hand on a running robot.
struct Session {
    robot: String,
    lookout: Lookout,
    stick: Publisher<Stick>,
    sequence: u64,
    was_held: bool,
}

impl Session {
    fn by_keys(&mut self, flag: &AtomicBool) -> Result<(), String> {
        let in_words = |error: std::io::Error| format!("the terminal fails: {error}");
        let mut screen = Screen::open(HELP).map_err(in_words)?;
        let mut hand = Hand::default();
        while !flag.load(Ordering::Relaxed) {
            let next = Instant::now() + PERIOD;
            while let Some(left) = next.checked_duration_since(Instant::now())
                && poll(left).map_err(in_words)?
            {
                let Event::Key(key) = read().map_err(in_words)? else { continue };
                let Some(wish) = wish(&key) else { continue };
                hand.press(wish, Instant::now());
                match wish {
                    Wish::End => return Ok(()),
                    Wish::EmergencyStop => self.emergency_stop()?,
                    Wish::Hold(_) => self.publish(hand.stick(Instant::now()))?,
                    _ => {}
                }
            }
            self.publish(hand.stick(Instant::now()))?;
            let what = self.what()?;
            let held = hand.stick(Instant::now());
            screen.show(&line(held, hand.share(), &what)).map_err(in_words)?;
        }
        Ok(())
    }

    /// Tells where the stick is held; of a hand that lets go, that it is in the middle, once.
    fn publish(&mut self, held: Option<[f64; 3]>) -> Result<(), String> {
        let was_held = std::mem::replace(&mut self.was_held, held.is_some());
        let Some([forward, left, turn]) = held.or_else(|| was_held.then_some([0.0; 3])) else {
            return Ok(());
        };
        self.sequence += 1;
        let stick = Stick { stamp_ns: Time::monotonic_now().0, sequence: self.sequence, forward, left, turn };
        self.stick.publish(&stick, &[]).map_err(|error| error.to_string())
    }

    fn emergency_stop(&mut self) -> Result<(), String> {
        let stopped = Desk::join(&self.robot).map_err(Into::into);
        let stopped = stopped.and_then(|mut desk| desk.ask(&Request::EmergencyStop));
        stopped.map(drop).map_err(|error| error.to_string())
    }

    /// What the robot does.
    fn what(&mut self) -> Result<String, String> {
        match self.lookout.look(Duration::from_secs(1)) {
            Ok(Some(told)) => {
                let explanation = explain(&told, self.lookout.scene());
                let speeds =
                    explanation.axes.iter().map(|axis| format!("{:.2} {}", axis.commanded, axis.unit));
                Ok(format!("{}   {}", speeds.collect::<Vec<_>>().join(", "), explanation.what))
            }
            Ok(None) => Err(format!("robot `{}` decides nothing any more", self.robot)),
            Err(error) => Err(error.to_string()),
        }
    }
}

/// Such as ` 50 %   forward   0.20 m/s, 0.00 rad/s   driving`.
fn line(held: Option<[f64; 3]>, share: f64, what: &str) -> String {
    let stick = match held {
        None => "no hand".to_owned(),
        Some([forward, left, turn]) => {
            let words = [
                (forward, "forward", "back"),
                (left, "to the left", "to the right"),
                (turn, "round left", "round right"),
            ];
            let words = words.into_iter().filter(|(share, ..)| *share != 0.0);
            let words: Vec<&str> = words
                .map(|(share, positive, negative)| if share > 0.0 { positive } else { negative })
                .collect();
            if words.is_empty() { "stand".to_owned() } else { words.join(", ") }
        }
    };
    format!("{:3.0} %  {stick:<20} {what}", 100.0 * share)
}
