//! What is wrong with a policy.

use std::fmt;
use std::time::Duration;

use yamabico_core::message::{Axes, Axis};

use super::{BehaviourPolicy, Contest, Policy, WireKind};
use crate::kinematics::Kinematics;

/// One mistake in a policy; behaviours and wires are named by their index.
#[derive(Clone, Debug, PartialEq)]
pub enum Mistake {
    /// Two behaviours have one name.
    SameName {
        /// The earlier one.
        first: usize,
        /// The later one.
        second: usize,
    },
    /// Two behaviours that drive have one priority, and the contest is strict.
    EqualPriorities {
        /// The earlier one.
        first: usize,
        /// The later one.
        second: usize,
    },
    /// A wire starts or ends at no behaviour.
    LooseWire {
        /// The wire.
        wire: usize,
    },
    /// A wire ends at a critical behaviour.
    WireOntoCritical {
        /// The wire.
        wire: usize,
    },
    /// Wires lead in a circle; a wire from a behaviour to itself is a circle of one.
    WireCycle {
        /// The wires, each starting where the one before ends.
        wires: Vec<usize>,
    },
    /// A critical behaviour is switched off: the robot would never move.
    CriticalDisabled {
        /// The behaviour.
        behaviour: usize,
    },
    /// It drives only along axes that the drive lacks.
    ClaimsNothingHere {
        /// The behaviour.
        behaviour: usize,
        /// What it claims.
        claims: Axes,
        /// What the drive has.
        has: Axes,
    },
    /// A behaviour that never abstains, or a wire that never lets go, inhibits it for ever.
    InhibitedForEver {
        /// The behaviour.
        behaviour: usize,
        /// The wire.
        wire: usize,
    },
    /// A behaviour of a higher priority that never abstains has every axis that it claims.
    NeverReached {
        /// The behaviour.
        behaviour: usize,
        /// Who stands before it.
        by: usize,
    },
    /// A number is not finite, or out of its range.
    OutOfRange {
        /// Which.
        quantity: Quantity,
        /// Its value, SI.
        value: f64,
    },
    /// The emergency deceleration is gentler than the normal one.
    GentleEmergency {
        /// On this axis.
        axis: Axis,
    },
    /// More behaviours than an index counts.
    TooMany {
        /// How many there are.
        behaviours: usize,
    },
}

/// A number of the policy that has a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The rate, above zero.
    RateHz,
    /// A largest speed, at least zero.
    Speed(Axis),
    /// A largest acceleration, above zero.
    Acceleration(Axis),
    /// A largest deceleration, above zero.
    Deceleration(Axis),
    /// An emergency deceleration, above zero.
    Emergency(Axis),
    /// A largest jerk, above zero; infinity switches it off.
    Jerk(Axis),
    /// Distance between the wheels, above zero.
    WheelBase,
    /// Radius of the ring of wheels, above zero.
    RingRadius,
    /// Wheel radius, above zero.
    WheelRadius,
    /// Largest wheel speed, above zero.
    WheelSpeed,
    /// Oldest stamp of this behaviour, above zero.
    MaxAge(usize),
    /// Oldest evidence of this behaviour, at least its oldest stamp.
    MaxEvidenceAge(usize),
    /// Deadline of this critical behaviour, above zero.
    Deadline(usize),
    /// Oldest measurement of this critical sensor, above zero.
    SensorMaxAge(usize),
}

impl Policy {
    /// Every mistake; none where the policy is sound.
    pub fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        if self.behaviours.len() >= usize::from(u16::MAX) {
            mistakes.push(Mistake::TooMany { behaviours: self.behaviours.len() });
        }
        self.check_names_and_priorities(&mut mistakes);
        self.check_wires(&mut mistakes);
        self.check_chances(&mut mistakes);
        self.check_numbers(&mut mistakes);
        mistakes
    }

    fn check_names_and_priorities(&self, mistakes: &mut Vec<Mistake>) {
        let drives = |b: &BehaviourPolicy| b.enabled && !b.claims.is_empty();
        for (second, b) in self.behaviours.iter().enumerate() {
            for (first, a) in self.behaviours[..second].iter().enumerate() {
                if a.name == b.name {
                    mistakes.push(Mistake::SameName { first, second });
                }
                if a.priority == b.priority && drives(a) && drives(b) && self.contest == Contest::Strict {
                    mistakes.push(Mistake::EqualPriorities { first, second });
                }
            }
            if b.critical && !b.enabled {
                mistakes.push(Mistake::CriticalDisabled { behaviour: second });
            }
        }
    }

    fn check_wires(&self, mistakes: &mut Vec<Mistake>) {
        for (wire, w) in self.wires.iter().enumerate() {
            match (self.behaviours.get(w.by), self.behaviours.get(w.what)) {
                (Some(_), Some(what)) if what.critical => mistakes.push(Mistake::WireOntoCritical { wire }),
                (Some(_), Some(_)) => {}
                _ => mistakes.push(Mistake::LooseWire { wire }),
            }
        }
        mistakes.extend(self.wire_cycles().into_iter().map(|wires| Mistake::WireCycle { wires }));
    }

    /// The shortest cycle through each wire that lies on one, each cycle once, starting at its first wire.
    fn wire_cycles(&self) -> Vec<Vec<usize>> {
        let mut cycles: Vec<Vec<usize>> = Vec::new();
        for start in 0..self.wires.len() {
            if cycles.iter().flatten().any(|&wire| wire == start) {
                continue;
            }
            let mut ways: Vec<Vec<usize>> = vec![vec![start]];
            let mut seen = vec![false; self.wires.len()];
            while let Some(position) = (!ways.is_empty()).then_some(0) {
                let way = ways.remove(position);
                let end = self.wires[way[way.len() - 1]].what;
                if end == self.wires[start].by {
                    cycles.push(way);
                    break;
                }
                for (wire, w) in self.wires.iter().enumerate() {
                    if w.by == end && !seen[wire] {
                        seen[wire] = true;
                        ways.push(way.iter().copied().chain([wire]).collect());
                    }
                }
            }
        }
        cycles
    }

    /// Behaviours that drive but can never win.
    fn check_chances(&self, mistakes: &mut Vec<Mistake>) {
        let has = self.axes();
        for (behaviour, b) in self.behaviours.iter().enumerate() {
            if b.claims.is_empty() || !b.enabled {
                continue;
            }
            let claims = b.claims.intersection(has);
            if claims.is_empty() {
                mistakes.push(Mistake::ClaimsNothingHere { behaviour, claims: b.claims, has });
                continue;
            }
            let for_ever = self.wires.iter().position(|wire| {
                let by = self.behaviours.get(wire.by);
                wire.kind == WireKind::Inhibit
                    && wire.what == behaviour
                    && by.is_some_and(|by| by.enabled && (by.never_abstains || wire.hold == Duration::MAX))
            });
            if let Some(wire) = for_ever {
                mistakes.push(Mistake::InhibitedForEver { behaviour, wire });
                continue;
            }
            let before = self.behaviours.iter().position(|other| {
                other.enabled
                    && other.never_abstains
                    && other.priority > b.priority
                    && claims.without(other.claims).is_empty()
            });
            if let Some(by) = before {
                mistakes.push(Mistake::NeverReached { behaviour, by });
            }
        }
    }

    fn check_numbers(&self, mistakes: &mut Vec<Mistake>) {
        let mut positive = |quantity: Quantity, value: f64| {
            let may_be_infinite = matches!(quantity, Quantity::Jerk(_));
            if !(value > 0.0 && (value.is_finite() || may_be_infinite)) {
                mistakes.push(Mistake::OutOfRange { quantity, value });
            }
        };
        positive(Quantity::RateHz, self.rate_hz);
        for axis in self.axes().iter() {
            let i = axis as usize;
            positive(Quantity::Acceleration(axis), self.limits.acceleration[i]);
            positive(Quantity::Deceleration(axis), self.limits.deceleration[i]);
            positive(Quantity::Emergency(axis), self.limits.emergency[i]);
            positive(Quantity::Jerk(axis), self.limits.jerk[i]);
        }
        match self.kinematics {
            Kinematics::Differential { base_m, wheel_radius_m, max_wheel_rad_s } => {
                positive(Quantity::WheelBase, base_m);
                positive(Quantity::WheelRadius, wheel_radius_m);
                positive(Quantity::WheelSpeed, max_wheel_rad_s);
            }
            Kinematics::Omni { ring_radius_m, wheel_radius_m, max_wheel_rad_s, .. } => {
                positive(Quantity::RingRadius, ring_radius_m);
                positive(Quantity::WheelRadius, wheel_radius_m);
                positive(Quantity::WheelSpeed, max_wheel_rad_s);
            }
            Kinematics::Body { .. } => {}
        }
        for (index, b) in self.behaviours.iter().enumerate() {
            positive(Quantity::MaxAge(index), b.max_age.as_secs_f64());
            if b.critical {
                positive(Quantity::Deadline(index), b.deadline.as_secs_f64());
            }
        }
        for (index, sensor) in self.sensors.iter().enumerate() {
            positive(Quantity::SensorMaxAge(index), sensor.max_age.as_secs_f64());
        }
        for (index, b) in self.behaviours.iter().enumerate() {
            if b.max_evidence_age < b.max_age {
                let value = b.max_evidence_age.as_secs_f64();
                mistakes.push(Mistake::OutOfRange { quantity: Quantity::MaxEvidenceAge(index), value });
            }
        }
        for axis in self.axes().iter() {
            let i = axis as usize;
            let value = self.limits.speed[i];
            if !(value >= 0.0 && value.is_finite()) {
                mistakes.push(Mistake::OutOfRange { quantity: Quantity::Speed(axis), value });
            }
            if self.limits.emergency[i] < self.limits.deceleration[i] {
                mistakes.push(Mistake::GentleEmergency { axis });
            }
        }
    }

    /// The words for a mistake, with the names of this policy.
    pub fn describe<'a>(&'a self, mistake: &'a Mistake) -> impl fmt::Display + 'a {
        Described { policy: self, mistake }
    }

    fn label(&self, index: usize) -> String {
        self.behaviours.get(index).map_or_else(|| format!("#{index}"), |b| b.name.to_string())
    }
}

struct Described<'a> {
    policy: &'a Policy,
    mistake: &'a Mistake,
}

impl fmt::Display for Described<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |index: usize| self.policy.label(index);
        let ends = |wire: usize| {
            let w = &self.policy.wires[wire];
            (name(w.by), name(w.what))
        };
        match self.mistake {
            Mistake::SameName { first, .. } => write!(f, "two behaviours are called {}", name(*first)),
            Mistake::EqualPriorities { first, second } => {
                let priority = self.policy.behaviours[*first].priority;
                write!(f, "{} and {} both have priority {priority}", name(*first), name(*second))
            }
            Mistake::LooseWire { wire } => write!(f, "wire {wire} does not join two behaviours"),
            Mistake::WireOntoCritical { wire } => {
                let (by, what) = ends(*wire);
                write!(f, "a wire from {by} ends at {what}, which is critical")
            }
            Mistake::WireCycle { wires } => {
                write!(f, "wires lead in a circle: ")?;
                for &wire in wires {
                    write!(f, "{} -> ", ends(wire).0)?;
                }
                write!(f, "{}", wires.first().map_or_else(String::new, |&wire| ends(wire).0))
            }
            Mistake::CriticalDisabled { behaviour } => {
                write!(f, "{} is critical and switched off: the robot would never move", name(*behaviour))
            }
            Mistake::ClaimsNothingHere { behaviour, claims, has } => {
                write!(f, "{} drives only {claims}, but the drive has {has}", name(*behaviour))
            }
            Mistake::InhibitedForEver { behaviour, wire } => {
                write!(f, "{} inhibits {} for ever", ends(*wire).0, name(*behaviour))
            }
            Mistake::NeverReached { behaviour, by } => {
                write!(f, "{} never abstains, so that {} never drives", name(*by), name(*behaviour))
            }
            Mistake::OutOfRange { quantity, value } => write!(f, "{quantity:?} is out of range: {value}"),
            Mistake::GentleEmergency { axis } => write!(
                f,
                "the emergency deceleration of the {} axis is gentler than the normal one",
                axis.as_str()
            ),
            Mistake::TooMany { behaviours } => write!(f, "{behaviours} behaviours are too many"),
        }
    }
}
