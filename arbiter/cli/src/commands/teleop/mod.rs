//! `yamabico teleop`: driving a running robot with the keyboard or a joystick.

mod joystick;
mod keys;
mod screen;

use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use crossterm::event::{Event, poll, read};
use yamabico_arbiter::decide::explain;
use yamabico_core::message::Stick;
use yamabico_core::time::Time;
use yamabico_host::bus::Publisher;
use yamabico_runtime::client::{Request, RobotClient};

use crate::interrupt::interrupt_flag;
use crate::output::{CommandResult, DONE, Failure};
use crate::robot_argument::RobotArgument;
use joystick::{AxisMap, Button, JoystickChoice};
use keys::{KeyCommand, Keyboard, command};
use screen::Screen;

/// Time between two stick messages.
const PERIOD: Duration = Duration::from_millis(50);
/// Maximum time between two decisions.
const TIMEOUT: Duration = Duration::from_secs(1);
/// Plugin that turns stick messages into proposals.
const PLUGIN: &str = "teleop";
const HELP: &str = "arrows or i , j l: drive while held   u o m .: arcs   J L: sideways   k: stop   + -: speed   space: emergency stop   q: end";

/// Arguments of `teleop`.
#[derive(Args)]
pub struct Arguments {
    /// Drives with a joystick instead of the keyboard, while its left upper trigger is held: with the first one, or with this
    /// device file.
    #[arg(long, value_name = "DEVICE", num_args = 0..=1)]
    joystick: Option<Option<PathBuf>>,
    /// Axes of the joystick that drive forward, left and turn left; a minus reverses one.
    #[arg(long, value_name = "AXES", default_value = "-y,-x,-rx", allow_hyphen_values = true)]
    axes: AxisMap,
    /// Button of the joystick that is held to drive.
    #[arg(long, value_name = "BUTTON", default_value = "tl")]
    hold: Button,
    /// List the joysticks, and show axes and buttons as they move, without a robot.
    #[arg(long, requires = "joystick")]
    list: bool,
    #[command(flatten)]
    robot: RobotArgument,
}

/// Drives until `q`, Ctrl-C, or the end of the robot.
pub fn teleop(arguments: &Arguments) -> CommandResult {
    let joystick = arguments.joystick.clone();
    let joystick =
        joystick.map(|device| JoystickChoice { device, axes: arguments.axes, hold: arguments.hold });
    if let Some(choice) = joystick.as_ref().filter(|_| arguments.list) {
        let interrupt = interrupt_flag()?;
        return joystick::list(choice, &interrupt).map(|()| DONE).map_err(Failure::device);
    }
    let robot = arguments.robot.choose()?;
    let mut client = RobotClient::join(&robot)?;
    let stick = client.stick()?;
    if !client.manifest()?.plugins.iter().any(|plugin| plugin.plugin == PLUGIN) {
        return Err(Failure::usage(format!(
            "robot `{robot}` has no teleop behavior: add `[behaviors.{PLUGIN}]` with `inputs = {{ stick = \"operator\" }}` to \
             its task, as in configs/teleop.toml"
        )));
    }
    if joystick.is_none() && !std::io::stdin().is_terminal() {
        return Err(Failure::usage(
            "standard input is not a terminal, so no keys can be read: run it in a terminal",
        ));
    }
    let interrupt = interrupt_flag()?;
    let mut session = Session { robot, client, stick, sequence: 0, was_held: false };
    let outcome = match joystick {
        Some(choice) => session.by_joystick(&choice, &interrupt),
        None => session.by_keys(&interrupt),
    };
    outcome.map(|()| DONE).map_err(Failure::not_done)
}

/// A connection to the robot that is driven.
struct Session {
    robot: String,
    client: RobotClient,
    stick: Publisher<Stick>,
    sequence: u64,
    was_held: bool,
}

impl Session {
    fn by_keys(&mut self, interrupt: &AtomicBool) -> Result<(), String> {
        let text = |error: std::io::Error| format!("the terminal failed: {error}");
        let mut screen = Screen::open(HELP).map_err(text)?;
        let mut keyboard = Keyboard::default();
        while !interrupt.load(Ordering::Relaxed) {
            let next = Instant::now() + PERIOD;
            while let Some(left) = next.checked_duration_since(Instant::now())
                && poll(left).map_err(text)?
            {
                let Event::Key(key) = read().map_err(text)? else { continue };
                let Some(command) = command(&key) else { continue };
                keyboard.take(command, Instant::now());
                match command {
                    KeyCommand::End => return Ok(()),
                    KeyCommand::EmergencyStop => self.emergency_stop()?,
                    KeyCommand::Drive(_) => self.publish(keyboard.deflection(Instant::now()))?,
                    _ => {}
                }
            }
            self.publish(keyboard.deflection(Instant::now()))?;
            let state = self.robot_state()?;
            let deflection = keyboard.deflection(Instant::now());
            screen.show(&line(deflection, keyboard.speed_share(), &state)).map_err(text)?;
        }
        Ok(())
    }

    /// Publishes the deflection of the stick, and once a deflection of zero after its release.
    fn publish(&mut self, deflection: Option<[f64; 3]>) -> Result<(), String> {
        let was_held = std::mem::replace(&mut self.was_held, deflection.is_some());
        let Some([forward, left, turn]) = deflection.or_else(|| was_held.then_some([0.0; 3])) else {
            return Ok(());
        };
        self.sequence += 1;
        let stick = Stick { stamp_ns: Time::monotonic_now().0, sequence: self.sequence, forward, left, turn };
        self.stick.publish(&stick, &[]).map_err(|error| error.to_string())
    }

    fn emergency_stop(&mut self) -> Result<(), String> {
        // A client of its own: the decisions received so far are older than the stop.
        let stopped =
            RobotClient::join(&self.robot).and_then(|mut client| client.request(&Request::EmergencyStop));
        stopped.map(drop).map_err(|error| error.to_string())
    }

    /// The commanded velocities and the mode of the robot, for example `0.20 m/s, 0.00 rad/s   driving`.
    fn robot_state(&mut self) -> Result<String, String> {
        match self.client.latest_decision(TIMEOUT) {
            Ok(Some(decision)) => {
                let explanation = explain(&decision, &self.client.context());
                let speeds =
                    explanation.axes.iter().map(|axis| format!("{:.2} {}", axis.commanded, axis.unit));
                Ok(format!("{}   {}", speeds.collect::<Vec<_>>().join(", "), explanation.what))
            }
            Ok(None) => {
                Err(format!("robot `{}` has made no decision for {} s", self.robot, TIMEOUT.as_secs()))
            }
            Err(error) => Err(error.to_string()),
        }
    }
}

/// The status line, for example ` 50 %   forward   0.20 m/s, 0.00 rad/s   driving`.
fn line(deflection: Option<[f64; 3]>, speed_share: f64, state: &str) -> String {
    let stick = match deflection {
        None => "released".to_owned(),
        Some([forward, left, turn]) => {
            let directions = [
                (forward, "forward", "backward"),
                (left, "left", "right"),
                (turn, "turn left", "turn right"),
            ];
            let directions = directions.into_iter().filter(|(share, ..)| *share != 0.0);
            let directions: Vec<&str> = directions
                .map(|(share, positive, negative)| if share > 0.0 { positive } else { negative })
                .collect();
            if directions.is_empty() { "stop".to_owned() } else { directions.join(", ") }
        }
    };
    format!("{:3.0} %  {stick:<20} {state}", 100.0 * speed_share)
}
