//! Connection to a joystick that may be unplugged, and comes back.

use std::io;
use std::time::{Duration, Instant};

use super::pad::{AxisMap, Button, DeadMan, PadState};

/// Time between two attempts to open a lost joystick.
const REOPEN_PERIOD: Duration = Duration::from_millis(500);

/// An open joystick. A test plays it.
pub trait Joystick {
    /// Reads its state.
    ///
    /// # Errors
    /// It was unplugged.
    fn state(&mut self) -> io::Result<PadState>;
}

/// Connection to a joystick. While it is lost, the stick is released.
pub struct Connection<J, O> {
    open: O,
    axes: AxisMap,
    hold: Button,
    link: Link<J>,
}

enum Link<J> {
    Open(J, DeadMan),
    Lost { next: Instant },
}

/// State of a connection.
#[derive(Clone, Debug, PartialEq)]
pub enum Contact {
    /// Connected: the deflection while the button is held (forward, left and turn, each -1 to 1), and the state.
    Connected(Option<[f64; 3]>, PadState),
    /// Unplugged.
    Lost,
}

impl<J: Joystick, O: FnMut() -> Result<J, String>> Connection<J, O> {
    /// Opens a joystick by `open`, now and after it was lost.
    ///
    /// # Errors
    /// It does not open, or lacks one of the axes.
    pub fn open(mut open: O, axes: AxisMap, hold: Button) -> Result<Connection<J, O>, String> {
        let link = connect(&mut open, axes, hold)?;
        Ok(Connection { open, axes, hold, link })
    }

    /// Reads the joystick at `now`, or tries to open it again.
    pub fn poll(&mut self, now: Instant) -> Contact {
        if let Link::Lost { next } = self.link {
            if now < next {
                return Contact::Lost;
            }
            self.link = connect(&mut self.open, self.axes, self.hold)
                .unwrap_or(Link::Lost { next: now + REOPEN_PERIOD });
        }
        if let Link::Open(joystick, dead_man) = &mut self.link
            && let Ok(state) = joystick.state()
        {
            return Contact::Connected(dead_man.take(&state), state);
        }
        self.link = Link::Lost { next: now + REOPEN_PERIOD };
        Contact::Lost
    }
}

fn connect<J: Joystick>(
    open: &mut impl FnMut() -> Result<J, String>,
    axes: AxisMap,
    hold: Button,
) -> Result<Link<J>, String> {
    let mut joystick = open()?;
    let state = joystick.state().map_err(|error| format!("the joystick was unplugged: {error}"))?;
    Ok(Link::Open(joystick, DeadMan::new(axes, hold, &state)?))
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use super::super::pad::{Axis, AxisPosition};
    use super::*;

    /// A joystick whose state is set from outside; `None` while it is unplugged.
    #[derive(Clone, Default)]
    struct Fake(Rc<RefCell<Option<PadState>>>);

    impl Joystick for Fake {
        fn state(&mut self) -> io::Result<PadState> {
            self.0.borrow().clone().ok_or_else(|| io::Error::from(io::ErrorKind::NotConnected))
        }
    }

    fn state(forward: i32, is_held: bool) -> PadState {
        let at = |value| AxisPosition { value, bounds: [-100, 100], flat: 0 };
        PadState {
            axes: [(Axis(0), at(0)), (Axis(1), at(forward)), (Axis(3), at(0))].into(),
            held: is_held.then_some(Button(310)).into_iter().collect(),
        }
    }

    #[test]
    fn an_unplugged_joystick_releases_the_stick_and_comes_back_disarmed() {
        let fake = Fake(Rc::new(RefCell::new(Some(state(0, false)))));
        let (plug, opens) = (Rc::clone(&fake.0), RefCell::new(0));
        let open = || {
            *opens.borrow_mut() += 1;
            if fake.0.borrow().is_some() { Ok(fake.clone()) } else { Err("not there".to_owned()) }
        };
        let mut connection = Connection::open(open, "-y,-x,-rx".parse().unwrap(), Button(310)).unwrap();
        let begin = Instant::now();
        let at = |millis| begin + Duration::from_millis(millis);
        let mut poll = |millis, state: Option<PadState>| {
            plug.replace(state);
            match connection.poll(at(millis)) {
                Contact::Connected(deflection, _) => Some(deflection.map(|[forward, ..]| forward)),
                Contact::Lost => None,
            }
        };
        assert_eq!(poll(0, Some(state(0, false))), Some(None));
        assert_eq!(poll(50, Some(state(-100, true))), Some(Some(1.0)));
        assert_eq!(poll(100, None), None, "unplugged at full speed");
        assert_eq!(poll(150, Some(state(-100, true))), None, "not tried at once");
        assert_eq!(poll(650, Some(state(-100, true))), Some(None), "back with a held button: not armed");
        assert_eq!(poll(700, Some(state(-100, true))), Some(None));
        assert_eq!(poll(750, Some(state(0, false))), Some(None));
        assert_eq!(poll(800, Some(state(-100, true))), Some(Some(1.0)));
        assert_eq!(poll(850, None), None);
        for millis in (900..3000).step_by(50) {
            assert_eq!(poll(millis, None), None);
        }
        assert!(*opens.borrow() <= 7, "{} attempts in 2 s", opens.borrow());
    }

    #[test]
    fn the_first_joystick_must_open() {
        let absent = || Err::<Fake, _>("no joystick is connected".to_owned());
        let error = Connection::open(absent, "-y,-x,-rx".parse().unwrap(), Button(310)).err();
        assert_eq!(error.as_deref(), Some("no joystick is connected"));
        let unplugged = || Ok(Fake::default());
        assert!(Connection::open(unplugged, "-y,-x,-rx".parse().unwrap(), Button(310)).is_err());
    }
}
