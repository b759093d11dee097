//! The terminal dashboard of a running robot.

mod echo;
mod screen;

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind};
use yamabico_runtime::client::{ClientError, Request, RobotClient};

use crate::live::LiveRobot;
use echo::Echo;
pub use screen::{Pane, Screen, draw};

/// Time between two looks at the robot's topics.
const STEP: Duration = Duration::from_millis(20);
/// Time between two drawings.
const DRAW_PERIOD: Duration = Duration::from_millis(200);

/// Failure of the dashboard.
#[derive(Debug, thiserror::Error)]
pub enum TopError {
    /// The robot cannot be read.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The terminal failed.
    #[error("the terminal failed: {0}")]
    Terminal(#[from] io::Error),
}

/// Shows the robot until `q`, Ctrl-C, or `interrupt`.
///
/// # Errors
/// The terminal failed.
pub fn show(mut robot: LiveRobot, interrupt: &AtomicBool) -> Result<(), TopError> {
    let mut terminal = ratatui::try_init()?;
    let result = run(&mut terminal, &mut robot, interrupt);
    ratatui::restore();
    result
}

fn run(
    terminal: &mut ratatui::DefaultTerminal,
    robot: &mut LiveRobot,
    interrupt: &AtomicBool,
) -> Result<(), TopError> {
    let mut screen = Screen::new(robot.robot());
    let mut echo: Option<Echo> = None;
    let mut drawn: Option<Instant> = None;
    while !interrupt.load(Ordering::Relaxed) {
        robot.step(None);
        let mut has_key = false;
        while event::poll(Duration::ZERO)? {
            if let Event::Key(key) = event::read()?
                && key.kind == KeyEventKind::Press
            {
                has_key = true;
                match press(&mut screen, robot, key.code) {
                    Pressed::Quit => return Ok(()),
                    Pressed::Switch(request) => screen.set_note(carry_out(robot.robot(), &request)),
                    Pressed::Nothing => {}
                }
            }
        }
        if drawn.is_none_or(|at| has_key || at.elapsed() >= DRAW_PERIOD) {
            drawn = Some(Instant::now());
            screen.set_running(robot.is_running());
            follow_topic(&mut screen, robot, &mut echo);
            terminal.draw(|frame| draw(frame, robot.model(), &screen))?;
        }
        std::thread::sleep(STEP);
    }
    Ok(())
}

/// Effect of a key.
enum Pressed {
    Nothing,
    Quit,
    Switch(Request),
}

fn press(screen: &mut Screen, robot: &LiveRobot, key: KeyCode) -> Pressed {
    let model = robot.model();
    match key {
        KeyCode::Char('q') => return Pressed::Quit,
        KeyCode::Esc if screen.pane() == Pane::Overview => return Pressed::Quit,
        KeyCode::Esc => screen.set_pane(Pane::Overview),
        KeyCode::Char('l') => screen.toggle(Pane::Log),
        KeyCode::Char('t') => screen.toggle(Pane::Topic),
        KeyCode::Up | KeyCode::Char('k') => screen.select_previous(),
        KeyCode::Down | KeyCode::Char('j') => screen.select_next(model),
        KeyCode::Char('e') => {
            return screen
                .selected_behavior(model)
                .map_or(Pressed::Nothing, |name| Pressed::Switch(Request::Enable(name)));
        }
        KeyCode::Char('d') => {
            return screen
                .selected_behavior(model)
                .map_or(Pressed::Nothing, |name| Pressed::Switch(Request::Disable(name)));
        }
        KeyCode::Char('s') => return Pressed::Switch(Request::EmergencyStop),
        KeyCode::Char('r') => return Pressed::Switch(Request::Reset),
        _ => {}
    }
    Pressed::Nothing
}

fn carry_out(robot: &str, request: &Request) -> String {
    match RobotClient::join(robot).and_then(|mut client| client.request(request)) {
        Ok(_) => match request {
            Request::Enable(name) => format!("{name} is enabled"),
            Request::Disable(name) => format!("{name} is disabled"),
            Request::EmergencyStop => "emergency stop latched".to_owned(),
            Request::Reset => "emergency stop released".to_owned(),
        },
        Err(error) => error.to_string(),
    }
}

/// Subscribes to the selected topic while it is shown, and hands its newest message to the screen.
fn follow_topic(screen: &mut Screen, robot: &LiveRobot, echo: &mut Option<Echo>) {
    if screen.pane() != Pane::Topic {
        *echo = None;
        return;
    }
    let Some(topic) = screen.selected_topic(robot.model()) else { return };
    if echo.as_ref().is_none_or(|echo| echo.topic() != topic) {
        match Echo::open(robot.robot(), &topic) {
            Ok(opened) => *echo = Some(opened),
            Err(error) => return screen.set_echo(vec![error.to_string()]),
        }
    }
    if let Some(echo) = echo {
        match echo.newest() {
            Ok(Some(lines)) => screen.set_echo(lines),
            Ok(None) => {}
            Err(error) => screen.set_echo(vec![error.to_string()]),
        }
    }
}
