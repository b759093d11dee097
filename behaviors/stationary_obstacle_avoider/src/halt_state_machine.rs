//! State machine: follow, halt, look again, search, avoid, rejoin. A step is a pure function of the state and its
//! input.
//!
//! Ohya, Kosaka & Kak (1998): every echo halts the robot, and after a halt it evaluates a new frame. Differs from
//! \[1\]: explicit conditions to release a halt, to search and to give up; a robot that cannot evaluate frames is
//! released where nothing is in its way, to continue slowly.

use serde::{Deserialize, Serialize};
use yamabico_core::geometry::angle_difference;

/// State of the avoider.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Follows its path; other behaviors drive.
    #[default]
    Follow,
    /// Brakes because of an echo or because there is no passage.
    Halt,
    /// Stands and waits for a frame captured since.
    Relook,
    /// Turns in place and looks for a passage.
    Search,
    /// Turns to a passage, then drives through it.
    Avoid,
    /// Returns to the path; other behaviors drive.
    Rejoin,
    /// Stands because the pose is unknown.
    Lost,
    /// Stands because no search found a passage.
    Blocked,
}

impl State {
    /// Returns the name of the state, as in the code.
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

/// Parameters of the state machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Number of steps without an echo after which the sonar counts as clear.
    pub clean_readings: u32,
    /// Number of steps without an echo after which an avoiding robot may drive.
    pub release_readings: u32,
    /// Speed below which the robot counts as standing, m/s.
    pub standing_mps: f64,
    /// Minimum bearing of a passage that leads past an echo, rad.
    pub min_bearing_rad: f64,
    /// Heading error up to which the robot is turned to its target, rad. It may drive at up to three times this
    /// error.
    pub aligned_rad: f64,
    /// Progress after which the obstacle is passed, m.
    pub passing_m: f64,
    /// Maximum duration of `Relook` before a search, s.
    pub relook_timeout_s: f64,
    /// Offset from the path above which the robot must rejoin it, m.
    pub off_path_m: f64,
    /// Offset from the path up to which the robot is on it, m.
    pub on_path_m: f64,
    /// Heading error up to which the robot is aligned with the path, rad.
    pub on_heading_rad: f64,
    /// Number of frames without a passage after which a search starts.
    pub looks: u32,
    /// Number of frames of a search after which the path counts as blocked.
    pub search_looks: u32,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            clean_readings: 3,
            release_readings: 3,
            standing_mps: 0.01,
            min_bearing_rad: 5_f64.to_radians(),
            aligned_rad: 3_f64.to_radians(),
            passing_m: 1.5,
            relook_timeout_s: 10.0,
            off_path_m: 0.10,
            on_path_m: 0.05,
            on_heading_rad: 5_f64.to_radians(),
            looks: 3,
            search_looks: 8,
        }
    }
}

impl Rules {
    /// Returns the number of frames, none of which could be evaluated, after which the robot is released in `state`.
    const fn looks_in(&self, state: State) -> u32 {
        match state {
            State::Search => self.search_looks,
            _ => self.looks,
        }
    }
}

/// Result of vision for one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisionResult {
    /// Capture time of the frame, s.
    pub image_s: f64,
    /// True if the frame could be evaluated.
    pub valid: bool,
    /// True if the path to the goal is clear; of a frame that could not be evaluated, if no remembered obstacle is on
    /// it.
    pub clear: bool,
    /// Bearing of the best passage, rad, positive left; `None` if there is none.
    pub bearing: Option<f64>,
}

/// Input of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Current time, s.
    pub now_s: f64,
    /// True if the sonar reports an obstacle on the path, or is silent.
    pub echo: bool,
    /// True if a remembered obstacle is beside the robot, or ahead of its side: it is not passed yet.
    pub beside: bool,
    /// Speed of the robot, m/s, of either sign.
    pub speed_mps: f64,
    /// Heading of the robot, rad. With NaN the robot neither turns nor drives.
    pub heading: f64,
    /// Offset from the path, m, positive left.
    pub lateral_m: f64,
    /// Heading relative to the path, rad.
    pub path_heading_error: f64,
    /// Progress along the path, m.
    pub progress_m: f64,
    /// True if the pose is known.
    pub pose_ok: bool,
    /// Vision result since the last step.
    pub vision: Option<VisionResult>,
}

/// State machine with its memory.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    state: State,
    target_heading: Option<f64>,
    clean: u32,
    requested_s: f64,
    entered_s: f64,
    looks: u32,
    /// Number of those looks that could be evaluated.
    #[serde(default)]
    valid_looks: u32,
    progress_mark_m: f64,
}

/// Output of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionOrder {
    /// State after the step.
    pub state: State,
    /// True if the robot must not translate.
    pub v_zero: bool,
    /// Heading to turn to (rad, frame of the input), while avoiding.
    pub target_heading: Option<f64>,
}

impl Machine {
    /// Creates a machine that follows its path and has a clear sonar.
    #[must_use]
    pub const fn new(rules: &Rules) -> Self {
        Self {
            state: State::Follow,
            target_heading: None,
            clean: rules.clean_readings,
            requested_s: 0.0,
            entered_s: 0.0,
            looks: 0,
            valid_looks: 0,
            progress_mark_m: 0.0,
        }
    }

    /// Returns the current state.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// Takes one step. Returns the machine after it, and its output.
    #[must_use]
    pub fn step(mut self, tick: &Tick, rules: &Rules) -> (Self, MotionOrder) {
        self.clean = if tick.echo { 0 } else { self.clean.saturating_add(1) };
        self.advance(tick, rules);
        let order = MotionOrder {
            state: self.state,
            v_zero: self.must_stand(tick, rules),
            target_heading: self.target_heading,
        };
        (self, order)
    }

    /// Returns the machine for a restarted behavior: `Relook`, `Search` and `Blocked` become `Halt`, which starts
    /// them anew.
    #[must_use]
    pub fn after_restart(mut self) -> Self {
        if matches!(self.state, State::Relook | State::Search | State::Blocked) {
            self.stop(State::Halt);
        }
        self
    }

    /// Starts a search because no passage found from here led on.
    #[must_use]
    pub fn start_search(mut self) -> (Self, MotionOrder) {
        self.search();
        (self, MotionOrder { state: State::Search, v_zero: true, target_heading: None })
    }

    /// Stops in `Blocked` because all searches at this place failed.
    #[must_use]
    pub fn block_path(mut self) -> (Self, MotionOrder) {
        self.stop(State::Blocked);
        (self, MotionOrder { state: State::Blocked, v_zero: true, target_heading: None })
    }

    fn advance(&mut self, tick: &Tick, rules: &Rules) {
        if !tick.pose_ok {
            return self.stop(State::Lost);
        }
        match self.state {
            State::Lost => self.relook(tick),
            State::Halt if tick.speed_mps.abs() < rules.standing_mps => self.relook(tick),
            State::Halt | State::Blocked => {}
            State::Relook | State::Search => self.evaluate(tick, rules),
            State::Follow | State::Rejoin | State::Avoid if tick.echo => {
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

    fn drive(&mut self, tick: &Tick, rules: &Rules) {
        if let Some(result) = tick.vision.filter(|result| result.valid && !result.clear) {
            return match result.bearing {
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

    fn avoid(&mut self, tick: &Tick, rules: &Rules) {
        if let Some(result) = tick.vision.filter(|result| result.valid) {
            match result.bearing {
                None => return self.stop(State::Halt),
                Some(bearing) if !result.clear => self.turn_to(tick, bearing),
                Some(_) => {}
            }
        }
        if tick.progress_m - self.progress_mark_m >= rules.passing_m && !tick.beside {
            self.stop(State::Rejoin);
        }
    }

    fn evaluate(&mut self, tick: &Tick, rules: &Rules) {
        if let Some(result) = tick.vision.filter(|result| result.image_s >= self.requested_s) {
            self.requested_s = tick.now_s;
            self.looks += 1;
            if result.valid {
                self.valid_looks += 1;
                match result.bearing {
                    Some(bearing) => self.choose(tick, rules, result.clear, bearing),
                    None if self.state == State::Relook && self.looks >= rules.looks => self.search(),
                    None => {}
                }
            } else if result.clear && self.valid_looks == 0 && self.looks >= rules.looks_in(self.state) {
                // No frame could be evaluated here, and neither the sonar nor the memory knows an obstacle.
                if self.clean >= rules.clean_readings {
                    self.release(tick, rules);
                }
            }
        }
        match self.state {
            State::Relook if tick.now_s - self.entered_s > rules.relook_timeout_s => self.search(),
            State::Search if self.looks >= rules.search_looks => self.stop(State::Blocked),
            _ => {}
        }
    }

    fn choose(&mut self, tick: &Tick, rules: &Rules, is_clear: bool, bearing: f64) {
        if self.clean < rules.clean_readings {
            if bearing.abs() >= rules.min_bearing_rad {
                self.turn_to(tick, bearing);
            }
        } else if is_clear {
            self.release(tick, rules);
        } else {
            self.turn_to(tick, bearing);
        }
    }

    /// Leaves the driving to other behaviors.
    fn release(&mut self, tick: &Tick, rules: &Rules) {
        let is_off = tick.lateral_m.abs() > rules.off_path_m;
        self.stop(if is_off { State::Rejoin } else { State::Follow });
    }

    fn stop(&mut self, state: State) {
        self.state = state;
        self.target_heading = None;
    }

    fn relook(&mut self, tick: &Tick) {
        self.stop(State::Relook);
        self.requested_s = tick.now_s;
        self.entered_s = tick.now_s;
        (self.looks, self.valid_looks) = (0, 0);
    }

    fn search(&mut self) {
        self.stop(State::Search);
        (self.looks, self.valid_looks) = (0, 0);
    }

    fn turn_to(&mut self, tick: &Tick, bearing: f64) {
        self.state = State::Avoid;
        self.target_heading = Some(tick.heading + bearing);
        self.progress_mark_m = tick.progress_m;
    }

    /// Returns true if the heading error is at most `rad`; false if the heading is NaN.
    fn is_turned_within(&self, tick: &Tick, rad: f64) -> bool {
        self.target_heading.is_none_or(|target| angle_difference(target, tick.heading).abs() <= rad)
    }

    fn must_stand(&self, tick: &Tick, rules: &Rules) -> bool {
        match self.state {
            State::Follow | State::Rejoin => false,
            State::Halt | State::Relook | State::Search | State::Lost | State::Blocked => true,
            State::Avoid => {
                tick.echo
                    || self.clean < rules.release_readings
                    || !self.is_turned_within(tick, 3.0 * rules.aligned_rad)
            }
        }
    }
}
