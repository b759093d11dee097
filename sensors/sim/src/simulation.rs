//! The world in motion: the body, the people, and who touched whom.

use std::collections::VecDeque;

use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::time::Time;

use crate::body::{Body, Urgency};
use crate::clearance;
use crate::scene::{Place, Scene};

/// Longest step of the integration.
const STEP_NS: u64 = 5_000_000;
/// States are kept this long, so that sensors can ask for the recent past.
const MEMORY_NS: u64 = 16_000_000_000;
/// Slower than this, the robot stands.
const STANDING_MPS: f64 = 0.01;
/// A touch has ended when the gap is wider than this.
const RELEASE_M: f64 = 0.01;

/// A body among solids and people, from the first instant that anybody asked for.
pub struct Simulation {
    /// The world as it looks; its people stand where the last picture needed them.
    pub scene: Scene,
    /// Radius of the footprint, meters.
    pub radius_m: f64,
    /// Things higher up than this are not run into, meters.
    pub height_m: f64,
    body: Body,
    origin: Option<Time>,
    past: VecDeque<Moment>,
    contacts: u32,
    struck: u32,
    touches_solid: bool,
    touches_person: bool,
    struck_standing: bool,
}

/// The body at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// When.
    pub at: Time,
    /// Where it is, world.
    pub pose: Pose2,
    /// How it moves, body frame.
    pub twist: Twist,
    /// Path length since the start, meters.
    pub distance_m: f64,
    /// Times that its own motion touched something.
    pub contacts: u32,
    /// Times that a person walked into it while it stood.
    pub struck: u32,
}

impl Simulation {
    /// A body in a scene.
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
        }
    }

    /// The instant that the run began at: the first that [`Simulation::advance`] was called for.
    #[must_use]
    pub fn origin(&self) -> Time {
        self.origin.unwrap_or_default()
    }

    /// Seconds since the run began.
    #[must_use]
    pub fn seconds(&self, at: Time) -> f64 {
        at.seconds_after(self.origin())
    }

    /// Moves everything on to `now`; does nothing when that has passed.
    pub fn advance(&mut self, now: Time) {
        if self.origin.is_none() {
            self.origin = Some(now);
            self.past.push_back(self.moment(now, 0.0));
        }
        while let Some(last) = self.past.back().copied().filter(|m| m.at < now) {
            let at = Time((last.at.0 + STEP_NS).min(now.0));
            self.step(&last, at);
        }
        let oldest = now.0.saturating_sub(MEMORY_NS);
        while self.past.get(1).is_some_and(|m| m.at.0 <= oldest) {
            self.past.pop_front();
        }
    }

    /// Moves on to `now` and takes a command there.
    pub fn command(&mut self, twist: &Twist, urgency: Urgency, now: Time) {
        self.advance(now);
        self.body.command(twist, urgency);
    }

    /// The body at an instant of the last sixteen seconds; the nearest known one otherwise.
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
            distance_m: before.distance_m + share * (next.distance_m - before.distance_m),
            ..*before
        }
    }

    /// Distances in meters from the footprint to the nearest thing (people included) and to the nearest person.
    #[must_use]
    pub fn clearance(&self, moment: &Moment) -> (f64, f64) {
        let solid = self.to_solids(&moment.pose);
        let person = self.to_people(&moment.pose, moment.at);
        (solid.min(person), person)
    }

    /// Where the people are at an instant.
    pub fn people(&self, at: Time) -> impl Iterator<Item = Place> {
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
        // Whoever struck the standing robot is touched by its own motion as soon as it sets off into them.
        if self.struck_standing && into_person && next.twist.speed() > last.twist.speed() {
            self.struck_standing = false;
            self.contacts += 1;
        }
        self.touches_solid &= solid < RELEASE_M;
        self.touches_person &= person < RELEASE_M;
        self.struck_standing &= self.touches_person;
        if into_solid || into_person {
            next.pose = last.pose;
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
            distance_m,
            contacts: self.contacts,
            struck: self.struck,
        }
    }
}
