//! Keys as drive commands. A terminal that does not report key releases repeats a held key: a key counts as released when it
//! stops repeating.

use std::time::{Duration, Instant};

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

/// Maximum delay before a terminal begins to repeat a held key.
const FIRST_REPEAT: Duration = Duration::from_millis(600);
/// Maximum time between two repetitions of a held key.
const REPEAT: Duration = Duration::from_millis(200);
/// Minimum and maximum share of the maximum speeds, and the step between two shares.
const SPEED_SHARES: (f64, f64, f64) = (0.1, 1.0, 0.1);

/// The command of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KeyCommand {
    /// Deflect the stick: forward, left and turn, each -1, 0 or 1.
    Drive([f64; 3]),
    /// Release the stick.
    Release,
    /// Raise the share of the maximum speeds.
    Faster,
    /// Lower the share of the maximum speeds.
    Slower,
    /// Request the emergency stop.
    EmergencyStop,
    /// End the program.
    End,
}

/// Returns the command of a key event; `None` for a key without one.
pub fn command(key: &KeyEvent) -> Option<KeyCommand> {
    if key.kind == KeyEventKind::Release {
        return matches!(press(key), Some(KeyCommand::Drive(_))).then_some(KeyCommand::Release);
    }
    press(key)
}

fn press(key: &KeyEvent) -> Option<KeyCommand> {
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return matches!(key.code, KeyCode::Char('c' | 'd')).then_some(KeyCommand::End);
    }
    let drive = |forward, left, turn| Some(KeyCommand::Drive([forward, left, turn]));
    match key.code {
        KeyCode::Up | KeyCode::Char('i' | 'w') => drive(1.0, 0.0, 0.0),
        KeyCode::Down | KeyCode::Char(',' | 's') => drive(-1.0, 0.0, 0.0),
        KeyCode::Left | KeyCode::Char('j' | 'a') => drive(0.0, 0.0, 1.0),
        KeyCode::Right | KeyCode::Char('l' | 'd') => drive(0.0, 0.0, -1.0),
        KeyCode::Char('u') => drive(1.0, 0.0, 1.0),
        KeyCode::Char('o') => drive(1.0, 0.0, -1.0),
        KeyCode::Char('m') => drive(-1.0, 0.0, -1.0),
        KeyCode::Char('.') => drive(-1.0, 0.0, 1.0),
        KeyCode::Char('J') => drive(0.0, 1.0, 0.0),
        KeyCode::Char('L') => drive(0.0, -1.0, 0.0),
        KeyCode::Char('k') => drive(0.0, 0.0, 0.0),
        KeyCode::Char('+' | '=') => Some(KeyCommand::Faster),
        KeyCode::Char('-') => Some(KeyCommand::Slower),
        KeyCode::Char(' ') => Some(KeyCommand::EmergencyStop),
        KeyCode::Char('q') | KeyCode::Esc => Some(KeyCommand::End),
        _ => None,
    }
}

/// The state of the keys: the one that is held, and the speed.
#[derive(Clone, Copy, Debug)]
pub struct Keyboard {
    /// Deflection, and the instant at which the key counts as released.
    held: Option<([f64; 3], Instant)>,
    speed_share: f64,
}

impl Default for Keyboard {
    /// No key held, half the maximum speeds.
    fn default() -> Self {
        Keyboard { held: None, speed_share: 0.5 }
    }
}

impl Keyboard {
    /// Takes the command of a key that was pressed, repeated or released at `now`.
    pub fn take(&mut self, command: KeyCommand, now: Instant) {
        let (min, max, step) = SPEED_SHARES;
        match command {
            KeyCommand::Drive(deflection) => {
                let repeats = self.held.is_some_and(|(before, until)| before == deflection && now <= until);
                let until = now + if repeats { REPEAT } else { FIRST_REPEAT };
                let until = self.held.filter(|_| repeats).map_or(until, |(_, before)| before.max(until));
                self.held = Some((deflection, until));
            }
            KeyCommand::Faster => self.speed_share = (self.speed_share + step).min(max),
            KeyCommand::Slower => self.speed_share = (self.speed_share - step).max(min),
            KeyCommand::Release | KeyCommand::EmergencyStop | KeyCommand::End => self.held = None,
        }
    }

    /// Deflection of the stick at `now`: forward, left and turn, shares of the maximum speeds; `None` if it is released.
    pub fn deflection(&self, now: Instant) -> Option<[f64; 3]> {
        let (deflection, until) = self.held?;
        (now <= until).then(|| deflection.map(|share| share * self.speed_share))
    }

    /// Share of the maximum speeds at full deflection, 0 to 1.
    pub fn speed_share(&self) -> f64 {
        self.speed_share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command_of(code: KeyCode) -> Option<KeyCommand> {
        command(&KeyEvent::new(code, KeyModifiers::NONE))
    }

    #[test]
    fn keys_have_the_usual_commands() {
        assert_eq!(command_of(KeyCode::Up), Some(KeyCommand::Drive([1.0, 0.0, 0.0])));
        assert_eq!(command_of(KeyCode::Left), Some(KeyCommand::Drive([0.0, 0.0, 1.0])), "left is positive");
        assert_eq!(command_of(KeyCode::Char('o')), Some(KeyCommand::Drive([1.0, 0.0, -1.0])));
        assert_eq!(command_of(KeyCode::Char(' ')), Some(KeyCommand::EmergencyStop));
        assert_eq!(command_of(KeyCode::Char('x')), None);
        assert_eq!(command(&KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL)), Some(KeyCommand::End));
        let up = KeyEvent::new_with_kind(KeyCode::Up, KeyModifiers::NONE, KeyEventKind::Release);
        assert_eq!(command(&up), Some(KeyCommand::Release));
        let plus = KeyEvent::new_with_kind(KeyCode::Char('+'), KeyModifiers::NONE, KeyEventKind::Release);
        assert_eq!(command(&plus), None);
    }

    #[test]
    fn a_key_is_held_until_it_stops_repeating() {
        let (mut keyboard, begin) = (Keyboard::default(), Instant::now());
        let at = |millis| begin + Duration::from_millis(millis);
        let forward = KeyCommand::Drive([1.0, 0.0, 0.0]);
        assert_eq!(keyboard.deflection(begin), None);
        keyboard.take(forward, begin);
        assert_eq!(keyboard.deflection(at(599)), Some([0.5, 0.0, 0.0]), "until the terminal repeats it");
        assert_eq!(keyboard.deflection(at(601)), None);
        keyboard.take(forward, at(500));
        keyboard.take(forward, at(540));
        assert!(keyboard.deflection(at(739)).is_some());
        assert_eq!(keyboard.deflection(at(741)), None, "released");
        keyboard.take(KeyCommand::Drive([0.0, 0.0, 1.0]), at(800));
        assert!(keyboard.deflection(at(1390)).is_some(), "another key starts over");
        keyboard.take(KeyCommand::Release, at(900));
        assert_eq!(keyboard.deflection(at(900)), None);
    }

    #[test]
    fn speeds_are_bounded() {
        let mut keyboard = Keyboard::default();
        (0..20).for_each(|_| keyboard.take(KeyCommand::Faster, Instant::now()));
        assert_eq!(keyboard.speed_share(), 1.0);
        (0..20).for_each(|_| keyboard.take(KeyCommand::Slower, Instant::now()));
        assert!((keyboard.speed_share() - 0.1).abs() < 1e-9);
    }
}
