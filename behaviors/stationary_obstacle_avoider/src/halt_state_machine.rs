//! Follow, halt, look again, search, avoid, rejoin: one step a tick, a pure function of the state and the tick.
//!
//! Ohya, Kosaka & Kak (1998): any echo halts, a halt is followed by a fresh look. Differs from \[1\]: how a halt is
//! released, when to search and when to give up are stated here.

use serde::{Deserialize, Serialize};
use yamabico_core::geometry::angle_difference;

/// What the robot is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// On its path.
    #[default]
    Follow,
    /// Braking for an echo or for want of a passage.
    Halt,
    /// Standing, waiting for a picture taken since.
    Relook,
    /// Turning in place, looking for a passage.
    Search,
    /// Turning to a passage and driving through it.
    Avoid,
    /// Returning to the path.
    Rejoin,
    /// The pose is not known.
    Lost,
    /// Nothing was found all around.
    Blocked,
}

impl State {
    /// The state's name, in the spelling of the code.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Follow => "Follow",
            Self::Halt => "Halt",
            Self::Relook => "Relook",
            Self::Search => "Search",
            Self::Avoid => "Avoid",
            Self::Rejoin => "Rejoin",
            Self::Lost => "Lost",
            Self::Blocked => "Blocked",
        }
    }
}

/// The numbers of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// A sonar range (m) strictly below this is an echo.
    pub gate_m: f64,
    /// Ticks without an echo after which the sonar counts as clear.
    pub clean_readings: u32,
    /// Ticks without an echo after which an avoiding robot may drive.
    pub release_readings: u32,
    /// Slower than this (m/s) is standing.
    pub standing_mps: f64,
    /// A passage at a smaller bearing (rad) does not lead past what the sonar sees.
    pub smallest_bearing_rad: f64,
    /// Turned to the target, radians; while three times this is left, the avoiding robot stands.
    pub aligned_rad: f64,
    /// Progress (m) that passes the obstacle.
    pub passing_m: f64,
    /// Longest look (s) before searching.
    pub patience_s: f64,
    /// An offset from the path (m) beyond this calls for rejoining it.
    pub off_path_m: f64,
    /// An offset (m) up to this is on the path.
    pub on_path_m: f64,
    /// A heading error (rad) up to this is along the path.
    pub on_heading_rad: f64,
    /// Pictures without a passage after which the search starts.
    pub looks: u32,
    /// Pictures of the search after which the way is blocked.
    pub search_looks: u32,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            gate_m: 0.5,
            clean_readings: 3,
            release_readings: 3,
            standing_mps: 0.01,
            smallest_bearing_rad: 5_f64.to_radians(),
            aligned_rad: 3_f64.to_radians(),
            passing_m: 1.5,
            patience_s: 10.0,
            off_path_m: 0.10,
            on_path_m: 0.05,
            on_heading_rad: 5_f64.to_radians(),
            looks: 3,
            search_looks: 8,
        }
    }
}

/// What vision found in one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// When the picture was taken, seconds.
    pub image_s: f64,
    /// Whether the result can be used.
    pub valid: bool,
    /// Whether the way to the goal is clear.
    pub clear: bool,
    /// Bearing (rad, positive left) of the best passage; `None` where there is none.
    pub bearing: Option<f64>,
}

/// What the machine is told in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick<'a> {
    /// Now, seconds.
    pub now_s: f64,
    /// Ranges of the sonars (m); `None` without an echo. No sonar at all counts as an echo.
    pub sonar_m: &'a [Option<f64>],
    /// Speed of the robot, m/s, either sign.
    pub speed_mps: f64,
    /// Heading of the robot, radians. NaN turns and drives nowhere.
    pub heading: f64,
    /// Offset from the path, meters, positive to the left.
    pub lateral_m: f64,
    /// Heading relative to the path, radians.
    pub path_heading_error: f64,
    /// Progress along the path, meters.
    pub progress_m: f64,
    /// Whether the pose is known.
    pub pose_ok: bool,
    /// A vision result that arrived since the last step.
    pub vision: Option<Look>,
}

/// What the machine remembers from step to step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    state: State,
    target_heading: Option<f64>,
    clean: u32,
    requested_s: f64,
    entered_s: f64,
    looks: u32,
    progress_mark_m: f64,
}

/// What the robot is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// The state after the step.
    pub state: State,
    /// Whether the robot must not translate.
    pub v_zero: bool,
    /// The absolute heading (rad) to turn to, while avoiding.
    pub target_heading: Option<f64>,
}

impl Machine {
    /// A machine that follows its path and has found the sonar clear.
    #[must_use]
    pub const fn new(rules: &Rules) -> Self {
        Self {
            state: State::Follow,
            target_heading: None,
            clean: rules.clean_readings,
            requested_s: 0.0,
            entered_s: 0.0,
            looks: 0,
            progress_mark_m: 0.0,
        }
    }

    /// The state.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// One step: the machine afterwards and what the robot is to do.
    #[must_use]
    pub fn step(mut self, tick: &Tick<'_>, rules: &Rules) -> (Self, Order) {
        let echo = tick.sonar_m.is_empty()
            || tick.sonar_m.iter().flatten().any(|&range| range < rules.gate_m || range.is_nan());
        self.clean = if echo { 0 } else { self.clean.saturating_add(1) };
        self.advance(tick, rules, echo);
        let order = Order {
            state: self.state,
            v_zero: self.must_stand(tick, rules, echo),
            target_heading: self.target_heading,
        };
        (self, order)
    }

    /// The machine of a robot whose avoider died and came back: what stood or looked around stands and looks again.
    #[must_use]
    pub fn come_back(mut self) -> Self {
        if matches!(self.state, State::Relook | State::Search | State::Blocked) {
            self.stop(State::Halt);
        }
        self
    }

    /// Searches, for nothing that was found from where it stands led anywhere.
    #[must_use]
    pub fn look_around(mut self) -> (Self, Order) {
        self.search();
        (self, Order { state: State::Search, v_zero: true, target_heading: None })
    }

    /// Stands, for nothing that was tried led anywhere.
    #[must_use]
    pub fn give_up(mut self) -> (Self, Order) {
        self.stop(State::Blocked);
        (self, Order { state: State::Blocked, v_zero: true, target_heading: None })
    }

    fn advance(&mut self, tick: &Tick<'_>, rules: &Rules, echo: bool) {
        if !tick.pose_ok {
            return self.stop(State::Lost);
        }
        match self.state {
            State::Lost => self.relook(tick),
            State::Halt if tick.speed_mps.abs() < rules.standing_mps => self.relook(tick),
            State::Halt | State::Blocked => {}
            State::Relook | State::Search => self.look(tick, rules),
            State::Follow | State::Rejoin | State::Avoid if echo => {
                let is_turning =
                    self.state == State::Avoid && !self.is_turned_within(tick, rules.aligned_rad);
                if !is_turning {
                    self.stop(State::Halt);
                }
            }
            State::Follow | State::Rejoin => self.drive(tick, rules),
            State::Avoid => self.avoid(tick, rules),
        }
    }

    fn drive(&mut self, tick: &Tick<'_>, rules: &Rules) {
        if let Some(look) = tick.vision.filter(|look| look.valid && !look.clear) {
            return match look.bearing {
                Some(bearing) => self.turn_to(tick, bearing),
                None => self.stop(State::Halt),
            };
        }
        let is_on_path =
            tick.lateral_m.abs() <= rules.on_path_m && tick.path_heading_error.abs() <= rules.on_heading_rad;
        if self.state == State::Rejoin && is_on_path {
            self.state = State::Follow;
        }
    }

    fn avoid(&mut self, tick: &Tick<'_>, rules: &Rules) {
        if let Some(look) = tick.vision.filter(|look| look.valid) {
            match look.bearing {
                None => return self.stop(State::Halt),
                Some(bearing) if !look.clear => self.turn_to(tick, bearing),
                Some(_) => {}
            }
        }
        if tick.progress_m - self.progress_mark_m >= rules.passing_m {
            self.stop(State::Rejoin);
        }
    }

    fn look(&mut self, tick: &Tick<'_>, rules: &Rules) {
        if let Some(look) = tick.vision.filter(|look| look.image_s >= self.requested_s) {
            self.requested_s = tick.now_s;
            self.looks += 1;
            if look.valid {
                match look.bearing {
                    Some(bearing) => self.choose(tick, rules, look.clear, bearing),
                    None if self.state == State::Relook && self.looks >= rules.looks => self.search(),
                    None => {}
                }
            }
        }
        match self.state {
            State::Relook if tick.now_s - self.entered_s > rules.patience_s => self.search(),
            State::Search if self.looks >= rules.search_looks => self.stop(State::Blocked),
            _ => {}
        }
    }

    fn choose(&mut self, tick: &Tick<'_>, rules: &Rules, is_clear: bool, bearing: f64) {
        if self.clean < rules.clean_readings {
            if bearing.abs() >= rules.smallest_bearing_rad {
                self.turn_to(tick, bearing);
            }
        } else if is_clear {
            let is_off = tick.lateral_m.abs() > rules.off_path_m;
            self.stop(if is_off { State::Rejoin } else { State::Follow });
        } else {
            self.turn_to(tick, bearing);
        }
    }

    fn stop(&mut self, state: State) {
        self.state = state;
        self.target_heading = None;
    }

    fn relook(&mut self, tick: &Tick<'_>) {
        self.stop(State::Relook);
        self.requested_s = tick.now_s;
        self.entered_s = tick.now_s;
        self.looks = 0;
    }

    fn search(&mut self) {
        self.stop(State::Search);
        self.looks = 0;
    }

    fn turn_to(&mut self, tick: &Tick<'_>, bearing: f64) {
        self.state = State::Avoid;
        self.target_heading = Some(tick.heading + bearing);
        self.progress_mark_m = tick.progress_m;
    }

    /// Whether at most `rad` is left to turn; no with a heading that is no number.
    fn is_turned_within(&self, tick: &Tick<'_>, rad: f64) -> bool {
        self.target_heading.is_none_or(|target| angle_difference(target, tick.heading).abs() <= rad)
    }

    fn must_stand(&self, tick: &Tick<'_>, rules: &Rules, echo: bool) -> bool {
        match self.state {
            State::Follow | State::Rejoin => false,
            State::Halt | State::Relook | State::Search | State::Lost | State::Blocked => true,
            State::Avoid => {
                echo || self.clean < rules.release_readings
                    || !self.is_turned_within(tick, 3.0 * rules.aligned_rad)
            }
        }
    }
}
