//! Motion of the robot's body and of people, and their collisions.

use std::collections::VecDeque;

use rand::RngExt;
use rand_distr::StandardNormal;
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::time::Time;

use crate::body::{Body, Urgency};
use crate::clearance;
use crate::random::Stream;
use crate::scene::{PersonPose, Scene};

/// Maximum integration step, ns.
const MAX_STEP_NS: u64 = 5_000_000;
/// Duration for which past states are kept for sensors with a latency, ns.
const HISTORY_NS: u64 = 16_000_000_000;
/// Speed up to which the robot counts as standing, m/s.
const STANDING_MPS: f64 = 0.01;
/// Clearance above which a contact has ended, m.
const RELEASE_M: f64 = 0.01;

/// Simulation of a body among solids and people. Time starts at the first call of [`Simulation::advance`].
pub struct Simulation {
    /// Scene to render; its people stand where they were at the time of the last frame.
    pub scene: Scene,
    /// Radius of the footprint, m.
    pub radius_m: f64,
    /// Height of the robot, m: it passes under higher solids.
    pub height_m: f64,
    body: Body,
    origin: Option<Time>,
    past: VecDeque<Moment>,
    contacts: u32,
    struck: u32,
    touches_solid: bool,
    touches_person: bool,
    struck_standing: bool,
    skid: Option<Skid>,
}

/// Random turn of the body in an emergency stop, which the wheels do not measure.
pub struct Skid {
    /// Standard deviation, rad.
    pub sigma_rad: f64,
    /// Source of the turns.
    pub random: Stream,
}

/// State of the body at one time.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Time of the state.
    pub at: Time,
    /// Pose in the world frame.
    pub pose: Pose2,
    /// Twist in the body frame.
    pub twist: Twist,
    /// Angle that the body has turned and the wheels have not measured, rad.
    pub skid_rad: f64,
    /// Distance driven since the start, m.
    pub distance_m: f64,
    /// Number of contacts caused by the robot's own motion.
    pub contacts: u32,
    /// Number of times that a person walked into the standing robot.
    pub struck: u32,
}

impl Simulation {
    /// Returns the simulation of a body with this radius and height (m) in a scene.
    #[must_use]
    pub fn new(scene: Scene, body: Body, radius_m: f64, height_m: f64) -> Self {
        Self {
            scene,
            radius_m,
            height_m,
            body,
            origin: None,
            past: VecDeque::new(),
            contacts: 0,
            struck: 0,
            touches_solid: false,
            touches_person: false,
            struck_standing: false,
            skid: None,
        }
    }

    /// Returns the simulation with skids in emergency stops.
    #[must_use]
    pub fn with_skid(self, skid: Skid) -> Self {
        Self { skid: Some(skid), ..self }
    }

    /// Returns the start time of the run: the time of the first call of [`Simulation::advance`].
    #[must_use]
    pub fn origin(&self) -> Time {
        self.origin.unwrap_or_default()
    }

    /// Returns the time since the start of the run, s.
    #[must_use]
    pub fn seconds(&self, at: Time) -> f64 {
        at.seconds_after(self.origin())
    }

    /// Advances the simulation to `now`; does nothing if it is already there or later.
    pub fn advance(&mut self, now: Time) {
        if self.origin.is_none() {
            self.origin = Some(now);
            self.past.push_back(self.moment(now, 0.0));
        }
        while let Some(last) = self.past.back().copied().filter(|m| m.at < now) {
            let at = Time((last.at.0 + MAX_STEP_NS).min(now.0));
            self.step(&last, at);
        }
        let oldest = now.0.saturating_sub(HISTORY_NS);
        while self.past.get(1).is_some_and(|m| m.at.0 <= oldest) {
            self.past.pop_front();
        }
    }

    /// Advances the simulation to `now` and applies a command.
    pub fn command(&mut self, twist: &Twist, urgency: Urgency, now: Time) {
        self.advance(now);
        let begins_stop = urgency == Urgency::Emergency && !self.body.is_emergency();
        self.body.command(twist, urgency);
        if let Some(skid) = &mut self.skid
            && begins_stop
            && self.body.twist.speed() > STANDING_MPS
        {
            let random: f64 = skid.random.sample(StandardNormal);
            self.body.skid(skid.sigma_rad * random);
        }
    }

    /// Returns the state of the body at a time within the last 16 s; otherwise the nearest kept state.
    #[must_use]
    pub fn at(&self, at: Time) -> Moment {
        let after = self.past.partition_point(|m| m.at <= at);
        let Some(before) = self.past.get(after.saturating_sub(1)) else { return self.moment(at, 0.0) };
        let Some(next) = self.past.get(after) else { return Moment { at, ..*before } };
        let dt = next.at.seconds_after(before.at);
        let share = at.seconds_after(before.at) / dt;
        let arc = Twist::logarithm(&before.pose.relative(&next.pose), dt);
        Moment {
            at,
            pose: before.pose.integrate(&arc, share * dt),
            skid_rad: before.skid_rad + share * (next.skid_rad - before.skid_rad),
            distance_m: before.distance_m + share * (next.distance_m - before.distance_m),
            ..*before
        }
    }

    /// Returns the distances (m) from the footprint to the nearest solid or person, and to the nearest person.
    #[must_use]
    pub fn clearance(&self, moment: &Moment) -> (f64, f64) {
        let solid = self.to_solids(&moment.pose);
        let person = self.to_people(&moment.pose, moment.at);
        (solid.min(person), person)
    }

    /// Returns the poses of the people at a time.
    pub fn people(&self, at: Time) -> impl Iterator<Item = PersonPose> {
        let seconds = self.seconds(at);
        self.scene.walkers().iter().map(move |w| w.at(seconds))
    }

    fn to_solids(&self, pose: &Pose2) -> f64 {
        clearance::to_solids(self.scene.solids(), [pose.x, pose.y], self.radius_m, self.height_m)
    }

    fn to_people(&self, pose: &Pose2, at: Time) -> f64 {
        clearance::to_people(self.people(at), [pose.x, pose.y], self.radius_m)
    }

    fn step(&mut self, last: &Moment, at: Time) {
        let (from_s, to_s) = (self.seconds(last.at), self.seconds(at));
        self.scene.give_way([last.pose.x, last.pose.y], self.radius_m, from_s, to_s);
        let mut next = self.body.stepped(at.seconds_after(last.at));
        let solid = self.to_solids(&next.pose);
        let person = self.to_people(&next.pose, at);
        let into_solid = solid < 0.0 && solid < self.to_solids(&last.pose);
        let into_person = person < 0.0 && person < self.to_people(&last.pose, at);
        let moving = last.twist.speed() > STANDING_MPS;

        if solid < 0.0 && !self.touches_solid {
            self.touches_solid = true;
            self.contacts += 1;
        }
        if person < 0.0 && !self.touches_person {
            self.touches_person = true;
            self.struck_standing = !moving;
            if moving { self.contacts += 1 } else { self.struck += 1 }
        }
        // After a person struck the standing robot, driving into that person counts as a contact.
        if self.struck_standing && into_person && next.twist.speed() > last.twist.speed() {
            self.struck_standing = false;
            self.contacts += 1;
        }
        self.touches_solid &= solid < RELEASE_M;
        self.touches_person &= person < RELEASE_M;
        self.struck_standing &= self.touches_person;
        if into_solid || into_person {
            next.pose = last.pose;
            next.skid_rad = last.skid_rad;
            next.twist = Twist::ZERO;
        }
        self.body = next;
        let moment = self.moment(at, last.distance_m + last.pose.distance(&next.pose));
        self.past.push_back(moment);
    }

    fn moment(&self, at: Time, distance_m: f64) -> Moment {
        Moment {
            at,
            pose: self.body.pose,
            twist: self.body.twist,
            skid_rad: self.body.skid_rad,
            distance_m,
            contacts: self.contacts,
            struck: self.struck,
        }
    }
}
