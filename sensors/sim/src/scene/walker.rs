//! Where a person is at a given time.

use rand::RngExt;

use super::PERSON_RADIUS_M;
use crate::random::stream;
use crate::world::Person;

/// A person's way, with the seed's jitter applied, and how long they have waited on it for somebody to pass.
#[derive(Clone, Debug)]
pub struct Walker {
    /// The person as described.
    pub person: Person,
    legs: Vec<Leg>,
    rest: [f64; 2],
    heading: f64,
    /// Begin and end, seconds after the start of the run.
    waits: Vec<[f64; 2]>,
    /// They have waited long enough for what is in the way.
    is_out_of_patience: bool,
}

/// Where somebody stands, which way they face and how their legs are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Position x and y, meters.
    pub at: [f64; 2],
    /// Direction of the face, radians.
    pub heading: f64,
    /// Velocity x and y, m/s.
    pub velocity: [f64; 2],
    /// How far the left foot is ahead of the body, meters (the right foot is as far behind).
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

/// Length of a double step, meters.
const GAIT_M: f64 = 1.3;
/// Who gives way does so to what would come nearer than this to their side, meters.
const ELBOW_ROOM_M: f64 = 0.1;
/// They wait for so long at most, and then squeeze past, seconds.
const PATIENCE_S: f64 = 30.0;
/// Largest distance of a foot ahead of the body, meters.
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
        Self { person: person.clone(), legs, rest, heading, waits: Vec::new(), is_out_of_patience: false }
    }

    /// Position and posture at `time_s` after the start of the run.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Place {
        let place = self.without_waits(time_s - self.waited_s(time_s));
        let waits = self.waits.iter().any(|[begin, end]| (*begin..*end).contains(&time_s));
        if waits { Place { velocity: [0.0; 2], ..place } } else { place }
    }

    /// Waits from `from_s` to `to_s`, seconds after the start of the run, where a body of `radius_m` at `center` is in the way.
    /// Only who gives way does, and not for ever.
    pub fn give_way(&mut self, center: [f64; 2], radius_m: f64, from_s: f64, to_s: f64) {
        if self.person.gives_way_m <= 0.0 {
            return;
        }
        let Place { at, velocity: [vx, vy], .. } = self.without_waits(from_s - self.waited_s(from_s));
        let speed = vx.hypot(vy);
        if speed <= 0.0 {
            return;
        }
        let [dx, dy] = [center[0] - at[0], center[1] - at[1]];
        let (ahead, aside) = ((dx * vx + dy * vy) / speed, (dx * vy - dy * vx).abs() / speed);
        let touch = PERSON_RADIUS_M + radius_m;
        let gap = dx.hypot(dy) - touch;
        if ahead <= 0.0 || aside > touch + ELBOW_ROOM_M || gap > self.person.gives_way_m {
            self.is_out_of_patience = false;
            return;
        }
        if self.is_out_of_patience {
            return;
        }
        match self.waits.last_mut().filter(|last| last[1] >= from_s) {
            Some(last) => {
                last[1] = to_s;
                self.is_out_of_patience = to_s - last[0] >= PATIENCE_S;
            }
            None => self.waits.push([from_s, to_s]),
        }
    }

    /// How much of the time before `time_s` they have waited, seconds.
    fn waited_s(&self, time_s: f64) -> f64 {
        let waits = self.waits.iter().map(|[begin, end]| time_s.min(*end) - begin);
        waits.filter(|waited| *waited > 0.0).sum()
    }

    fn without_waits(&self, time_s: f64) -> Place {
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
    use super::*;
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

    #[test]
    fn who_gives_way_waits_for_what_is_in_the_way_and_goes_on() {
        let text = "[[person]]\npath_m = [[0, 0], [4, 0]]\nspeed_mps = 1\ngives_way_m = 0.5";
        let person = World::from_toml(text).unwrap().people.remove(0);
        let walk = |person: &Person, center: [f64; 2], until_s: f64| {
            let mut walker = Walker::new(person, 0, 1);
            for step in 0..5000 {
                let from_s = f64::from(step) * 0.01;
                let center = if from_s < until_s { center } else { [50.0, 50.0] };
                walker.give_way(center, 0.2, from_s, f64::from(step + 1) * 0.01);
            }
            walker
        };
        // Stands half a meter before it, for as long as it is there.
        let touch = PERSON_RADIUS_M + 0.2;
        let waited = walk(&person, [2.005, 0.0], 4.0);
        let stop = 2.005 - touch - 0.5;
        let place = waited.at(3.0);
        assert!((place.at[0] - stop).abs() < 0.02 && place.velocity == [0.0; 2], "{place:?}");
        // The past stays as it was, and the walk goes on where it was.
        assert!((waited.at(1.0).at[0] - 1.0).abs() < 1e-9 && waited.at(1.0).velocity == [1.0, 0.0]);
        assert!((waited.at(5.0).at[0] - stop - 1.0).abs() < 0.03, "{:?}", waited.at(5.0));
        // Who has waited for long goes on all the same.
        let squeezed = walk(&person, [2.005, 0.0], 50.0);
        let at = squeezed.at(stop + PATIENCE_S + 1.0);
        assert!((at.at[0] - stop - 1.0).abs() < 0.03, "{at:?}");
        // What is beside the way or behind, and who walks on whatever is there.
        assert_eq!(walk(&person, [2.0, touch + 0.2], 10.0).at(3.0).at, [3.0, 0.0]);
        assert_eq!(walk(&person, [-0.5, 0.0], 10.0).at(3.0).at, [3.0, 0.0]);
        let blind = Person { gives_way_m: 0.0, ..person };
        assert_eq!(walk(&blind, [2.0, 0.0], 10.0).at(3.0).at, [3.0, 0.0]);
    }
}
