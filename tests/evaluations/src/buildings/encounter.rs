//! Contacts of the robot with boxes, walls and people, with the bearing of the person.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Message, MessageType, RawMessage, Truth, View};
use yamabico_core::time::Time;
use yamabico_runtime::record::Tap;
use yamabico_sim::World;
use yamabico_sim::scene::Walker;

/// Distance below which a contact is one with a person, m.
const NEAR_M: f64 = 0.05;
/// Speed toward a person up to which the person, not the robot, made the contact, m/s.
const STANDING_MPS: f64 = 0.01;

/// Contact of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encounter {
    /// The robot drove into a box, a wall or a door.
    Solid,
    /// The robot drove into a person.
    IntoPerson {
        /// Direction of the person in the robot frame, degrees, positive to the left.
        bearing_deg: f64,
    },
    /// A person walked into the robot, which stood or moved away.
    TouchedByPerson {
        /// Direction of the person in the robot frame, degrees, positive to the left.
        bearing_deg: f64,
    },
}

impl Encounter {
    /// Returns true if the robot's own motion made the contact.
    pub fn is_driven_into(self) -> bool {
        !matches!(self, Self::TouchedByPerson { .. })
    }
}

/// Collects the contacts of a run. People are followed as the simulator moves them, since no message shows them.
pub struct EncounterTap {
    walkers: Vec<Walker>,
    radius_m: f64,
    origin_ns: Option<u64>,
    last: Option<Truth>,
    /// The contacts so far.
    pub encounters: Vec<Encounter>,
}

impl EncounterTap {
    /// Returns a tap for the run of `seed` by a robot of this radius (m).
    pub fn new(world: &World, seed: u64, radius_m: f64) -> Self {
        let walkers =
            world.people.iter().enumerate().map(|(i, person)| Walker::new(person, i, seed)).collect();
        Self { walkers, radius_m, origin_ns: None, last: None, encounters: Vec::new() }
    }

    /// Returns the world x of the robot at the end, m.
    pub fn end_x_m(&self) -> f64 {
        self.last.map_or(0.0, |truth| truth.x)
    }

    fn step(&mut self, now: &Truth) {
        let origin_ns = *self.origin_ns.get_or_insert(now.stamp_ns);
        let seconds = |stamp_ns: u64| (stamp_ns - origin_ns) as f64 * 1e-9;
        let Some(last) = self.last.replace(*now) else { return };
        let (from_s, to_s) = (seconds(last.stamp_ns), seconds(now.stamp_ns));
        for walker in &mut self.walkers {
            walker.give_way([last.x, last.y], self.radius_m, from_s, to_s);
        }
        for _ in last.struck..now.struck {
            let bearing_deg = self.nearest_deg(now, to_s);
            self.encounters.push(Encounter::TouchedByPerson { bearing_deg });
        }
        for _ in last.contacts..now.contacts {
            let encounter = if last.person_m.min(now.person_m) > NEAR_M {
                Encounter::Solid
            } else {
                let bearing_deg = self.nearest_deg(now, to_s);
                let toward_mps = last.vx.max(now.vx) * bearing_deg.to_radians().cos();
                if toward_mps > STANDING_MPS {
                    Encounter::IntoPerson { bearing_deg }
                } else {
                    Encounter::TouchedByPerson { bearing_deg }
                }
            };
            self.encounters.push(encounter);
        }
    }

    /// Returns the bearing of the nearest person, degrees.
    fn nearest_deg(&self, robot: &Truth, time_s: f64) -> f64 {
        let from_world = Pose2::new(robot.x, robot.y, robot.theta).inverse();
        let seen =
            self.walkers.iter().map(|walker| from_world.transform_point(Point2::from(walker.at(time_s).at)));
        let nearest = seen.min_by(|a, b| a.coords.norm().total_cmp(&b.coords.norm()));
        nearest.map_or(f64::NAN, |at| at.y.atan2(at.x).to_degrees())
    }
}

impl Tap for EncounterTap {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        if message.name != Truth::NAME {
            return;
        }
        if let Some(truth) = View::<Truth>::of(RawMessage { header, items }) {
            self.step(truth.header);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the contacts of a robot that drives along x at 1 m/s, with a person at x = 2 m and these counts at the end.
    fn contacts(heading: f64, person_m: f64, contacts: u32, struck: u32) -> Vec<Encounter> {
        let world = World::from_toml("[[person]]\npath_m = [[2, 0]]").unwrap();
        let mut tap = EncounterTap::new(&world, 1, 0.2);
        let truth = |i: u64| Truth {
            stamp_ns: 7 + i * 20_000_000,
            x: 1.5,
            theta: heading,
            vx: 1.0,
            person_m,
            contacts: if i == 2 { contacts } else { 0 },
            struck: if i == 2 { struck } else { 0 },
            ..Truth::default()
        };
        (0..4).for_each(|i| tap.step(&truth(i)));
        tap.encounters
    }

    #[test]
    fn contacts_are_told_apart_by_person_and_bearing() {
        assert_eq!(contacts(0.0, 1.0, 1, 0), [Encounter::Solid]);
        assert!(contacts(0.0, 0.0, 0, 0).is_empty());
        let side = |found: Vec<Encounter>| match found[..] {
            [Encounter::IntoPerson { bearing_deg }] => (true, bearing_deg.round() as i32),
            [Encounter::TouchedByPerson { bearing_deg }] => (false, bearing_deg.round() as i32),
            _ => panic!("{found:?}"),
        };
        assert_eq!(side(contacts(0.0, 0.0, 1, 0)), (true, 0));
        assert_eq!(side(contacts(-1.0, 0.0, 1, 0)), (true, 57));
        // A person who catches up from behind, and one who walks into the standing robot.
        assert_eq!(side(contacts(2.5, 0.0, 1, 0)), (false, -143));
        assert_eq!(side(contacts(0.0, 0.0, 0, 1)), (false, 0));
    }
}
