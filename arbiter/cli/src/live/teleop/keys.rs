//! What keys mean, and how long a key counts as held in a terminal that does not tell when it is let go.

use std::time::{Duration, Instant};

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

/// A terminal begins to repeat a key that is held within so long.
const FIRST: Duration = Duration::from_millis(600);
/// And then repeats it at least so often.
const REPEAT: Duration = Duration::from_millis(200);
/// Smallest and largest share of the largest speeds, and the step from one to the next.
const SHARES: (f64, f64, f64) = (0.1, 1.0, 0.1);

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// Hold the stick there: forward, left and turn, each -1, 0 or 1.
    Hold([f64; 3]),
    /// Let it go.
    LetGo,
    /// A larger share of the largest speeds.
    Faster,
    /// A smaller one.
    Slower,
    /// The emergency stop.
    EmergencyStop,
    /// End.
    End,
}

/// What a key asks for; `None` for a key that means nothing here.
pub fn wish(key: &KeyEvent) -> Option<Wish> {
    if key.kind == KeyEventKind::Release {
        return matches!(wish_of(key), Some(Wish::Hold(_))).then_some(Wish::LetGo);
    }
    wish_of(key)
}

fn wish_of(key: &KeyEvent) -> Option<Wish> {
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return matches!(key.code, KeyCode::Char('c' | 'd')).then_some(Wish::End);
    }
    let hold = |forward, left, turn| Some(Wish::Hold([forward, left, turn]));
    match key.code {
        KeyCode::Up | KeyCode::Char('i' | 'w') => hold(1.0, 0.0, 0.0),
        KeyCode::Down | KeyCode::Char(',' | 's') => hold(-1.0, 0.0, 0.0),
        KeyCode::Left | KeyCode::Char('j' | 'a') => hold(0.0, 0.0, 1.0),
        KeyCode::Right | KeyCode::Char('l' | 'd') => hold(0.0, 0.0, -1.0),
        KeyCode::Char('u') => hold(1.0, 0.0, 1.0),
        KeyCode::Char('o') => hold(1.0, 0.0, -1.0),
        KeyCode::Char('m') => hold(-1.0, 0.0, -1.0),
        KeyCode::Char('.') => hold(-1.0, 0.0, 1.0),
        KeyCode::Char('J') => hold(0.0, 1.0, 0.0),
        KeyCode::Char('L') => hold(0.0, -1.0, 0.0),
        KeyCode::Char('k') => hold(0.0, 0.0, 0.0),
        KeyCode::Char('+' | '=') => Some(Wish::Faster),
        KeyCode::Char('-') => Some(Wish::Slower),
        KeyCode::Char(' ') => Some(Wish::EmergencyStop),
        KeyCode::Char('q') | KeyCode::Esc => Some(Wish::End),
        _ => None,
    }
}

/// A hand on the keys.
#[derive(Clone, Copy, Debug)]
pub struct Hand {
    held: Option<([f64; 3], Instant)>,
    share: f64,
}

impl Default for Hand {
    /// One that holds nothing, and would drive at half the largest speeds.
    fn default() -> Self {
        Hand { held: None, share: 0.5 }
    }
}

impl Hand {
    /// A key that asks for `wish` was pressed, or repeats, at `now`.
    pub fn press(&mut self, wish: Wish, now: Instant) {
        let (least, most, step) = SHARES;
        match wish {
            Wish::Hold(place) => {
                let repeats = self.held.is_some_and(|(before, until)| before == place && now <= until);
                let until = now + if repeats { REPEAT } else { FIRST };
                let until = self.held.filter(|_| repeats).map_or(until, |(_, before)| before.max(until));
                self.held = Some((place, until));
            }
            Wish::Faster => self.share = (self.share + step).min(most),
            Wish::Slower => self.share = (self.share - step).max(least),
            Wish::LetGo | Wish::EmergencyStop | Wish::End => self.held = None,
        }
    }

    /// Where the stick is at `now`, in shares; `None` where nobody holds it.
    pub fn stick(&self, now: Instant) -> Option<[f64; 3]> {
        let (place, until) = self.held?;
        (now <= until).then(|| place.map(|share| share * self.share))
    }

    /// The share of the largest speeds.
    pub fn share(&self) -> f64 {
        self.share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(code: KeyCode) -> Option<Wish> {
        wish(&KeyEvent::new(code, KeyModifiers::NONE))
    }

    #[test]
    fn keys_mean_what_the_hand_expects() {
        assert_eq!(press(KeyCode::Up), Some(Wish::Hold([1.0, 0.0, 0.0])));
        assert_eq!(press(KeyCode::Left), Some(Wish::Hold([0.0, 0.0, 1.0])), "left is positive");
        assert_eq!(press(KeyCode::Char('o')), Some(Wish::Hold([1.0, 0.0, -1.0])));
        assert_eq!(press(KeyCode::Char(' ')), Some(Wish::EmergencyStop));
        assert_eq!(press(KeyCode::Char('x')), None);
        assert_eq!(wish(&KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL)), Some(Wish::End));
        let up = KeyEvent::new_with_kind(KeyCode::Up, KeyModifiers::NONE, KeyEventKind::Release);
        assert_eq!(wish(&up), Some(Wish::LetGo));
        let plus = KeyEvent::new_with_kind(KeyCode::Char('+'), KeyModifiers::NONE, KeyEventKind::Release);
        assert_eq!(wish(&plus), None);
    }

    #[test]
    fn a_key_is_held_until_it_stops_to_repeat() {
        let (mut hand, begin) = (Hand::default(), Instant::now());
        let at = |millis| begin + Duration::from_millis(millis);
        let forward = Wish::Hold([1.0, 0.0, 0.0]);
        assert_eq!(hand.stick(begin), None);
        hand.press(forward, begin);
        assert_eq!(hand.stick(at(599)), Some([0.5, 0.0, 0.0]), "until the terminal repeats it");
        assert_eq!(hand.stick(at(601)), None);
        hand.press(forward, at(500));
        hand.press(forward, at(540));
        assert!(hand.stick(at(739)).is_some());
        assert_eq!(hand.stick(at(741)), None, "let go");
        hand.press(Wish::Hold([0.0, 0.0, 1.0]), at(800));
        assert!(hand.stick(at(1390)).is_some(), "another key begins anew");
        hand.press(Wish::LetGo, at(900));
        assert_eq!(hand.stick(at(900)), None);
    }

    #[test]
    fn speeds_have_ends() {
        let mut hand = Hand::default();
        (0..20).for_each(|_| hand.press(Wish::Faster, Instant::now()));
        assert_eq!(hand.share(), 1.0);
        (0..20).for_each(|_| hand.press(Wish::Slower, Instant::now()));
        assert!((hand.share() - 0.1).abs() < 1e-9);
    }
}
