//! Where a person is at a given time.

use rand::RngExt;

use crate::random::stream;
use crate::world::Person;

/// A person's way, with the seed's jitter applied.
#[derive(Clone, Debug)]
pub struct Walker {
    /// The person as described.
    pub person: Person,
    legs: Vec<Leg>,
    rest: [f64; 2],
    heading: f64,
}

/// Where somebody stands, which way they face and how their legs are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Position x and y, metres.
    pub at: [f64; 2],
    /// Direction of the face, radians.
    pub heading: f64,
    /// Velocity x and y, m/s.
    pub velocity: [f64; 2],
    /// How far the left foot is ahead of the body, metres (the right foot is as far behind).
    pub stride: f64,
}

#[derive(Clone, Copy, Debug)]
struct Leg {
    from: [f64; 2],
    to: [f64; 2],
    begins_s: f64,
    ends_s: f64,
    heading: f64,
}

/// Length of a double step, metres.
const GAIT_M: f64 = 1.3;
/// Largest distance of a foot ahead of the body, metres.
const STRIDE_M: f64 = 0.26;

impl Walker {
    /// The walk of person number `index` in the run of `seed`.
    #[must_use]
    pub fn new(person: &Person, index: usize, seed: u64) -> Self {
        let mut rng = stream(seed, &format!("person {index}"));
        let jitter = rng.random_range(-1.0..=1.0) * person.jitter_s;
        let mut time = (person.start_s + jitter).max(0.0);
        let pause = |i: usize| person.pause_s.get(i).copied().unwrap_or(0.0);
        let mut legs: Vec<Leg> = Vec::new();
        for (i, pair) in person.path_m.windows(2).enumerate() {
            let (from, to) = (pair[0], pair[1]);
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let begins_s = time + pause(i);
            let ends_s = begins_s + dx.hypot(dy) / person.speed_mps;
            legs.push(Leg { from, to, begins_s, ends_s, heading: dy.atan2(dx) });
            time = ends_s;
        }
        let heading = legs.first().map_or(0.0, |l| l.heading);
        let rest = person.path_m.first().copied().unwrap_or_default();
        Self { person: person.clone(), legs, rest, heading }
    }

    /// Position and posture at `time_s` after the start of the run.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Place {
        let mut place = Place { at: self.rest, heading: self.heading, velocity: [0.0; 2], stride: 0.0 };
        for leg in self.legs.iter().take_while(|l| l.begins_s <= time_s) {
            let span = (leg.ends_s - leg.begins_s).max(1e-9);
            let share = ((time_s - leg.begins_s) / span).min(1.0);
            place.heading = leg.heading;
            place.at = [0, 1].map(|k| leg.from[k] + (leg.to[k] - leg.from[k]) * share);
            let walking = share < 1.0;
            place.velocity = [0, 1].map(|k| if walking { (leg.to[k] - leg.from[k]) / span } else { 0.0 });
            let gone = (time_s - leg.begins_s).min(span) * self.person.speed_mps;
            let left = span * self.person.speed_mps - gone;
            let ease = (gone.min(left) / 0.3).min(1.0);
            place.stride = STRIDE_M * ease * (std::f64::consts::TAU * gone / GAIT_M).sin();
        }
        place
    }
}

#[cfg(test)]
mod tests {
    use super::Walker;
    use crate::world::World;

    #[test]
    fn a_walk_pauses_at_its_corners_and_starts_within_its_jitter() {
        let text = "[[person]]\npath_m = [[0, 0], [2, 0], [2, 4]]\npause_s = [0, 3]\nstart_s = 5\nspeed_mps = 1\njitter_s = 0.5";
        let world = World::from_toml(text).unwrap();
        let mut person = world.people[0].clone();
        let starts: Vec<f64> = (0..50)
            .map(|seed| {
                let walker = Walker::new(&person, 0, seed);
                (0..1000).map(|i| 4.0 + f64::from(i) * 0.002).find(|t| walker.at(*t).at[0] > 0.0).unwrap()
            })
            .collect();
        assert!(starts.iter().all(|s| (4.5..=5.51).contains(s)), "{starts:?}");
        assert!(starts.iter().any(|s| *s < 4.8) && starts.iter().any(|s| *s > 5.2));

        person.jitter_s = 0.0;
        let walker = Walker::new(&person, 0, 1);
        assert_eq!(walker.at(4.0).at, [0.0, 0.0]);
        assert_eq!(walker.at(6.0).at, [1.0, 0.0]);
        assert_eq!(walker.at(9.0).at, [2.0, 0.0]);
        assert_eq!(walker.at(9.0).velocity, [0.0, 0.0]);
        assert_eq!(walker.at(12.0).at, [2.0, 2.0]);
        assert_eq!(walker.at(60.0).at, [2.0, 4.0]);
    }
}
