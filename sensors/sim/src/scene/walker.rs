//! Walk of a person: position and posture over time.

use rand::RngExt;

use super::PERSON_RADIUS_M;
use crate::random::stream;
use crate::world::Person;
use yamabico_core::geometry::Hypotenuse;

/// Walk of a person along a path, with the jitter of the seed and the waits for the robot.
#[derive(Clone, Debug)]
pub struct Walker {
    /// Description of the person in the world file.
    pub person: Person,
    legs: Vec<Leg>,
    rest: [f64; 2],
    heading: f64,
    /// Start and end of every wait, seconds after the start of the run.
    waits: Vec<[f64; 2]>,
    /// True if the person has waited for the maximum time, until the path is clear again.
    has_timed_out: bool,
}

/// Pose and posture of a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PersonPose {
    /// Position x and y in the world frame, m.
    pub at: [f64; 2],
    /// Direction that the person faces, rad.
    pub heading: f64,
    /// Velocity x and y in the world frame, m/s.
    pub velocity: [f64; 2],
    /// Distance of the left foot ahead of the body, m; the right foot is as far behind.
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

/// Length of a double step, m.
const GAIT_M: f64 = 1.3;
/// Lateral clearance below which a person gives way, m.
const LATERAL_CLEARANCE_M: f64 = 0.1;
/// Maximum time for which a person waits, s.
const MAX_WAIT_S: f64 = 30.0;
/// Maximum distance of a foot ahead of the body, m.
const MAX_STRIDE_M: f64 = 0.26;

impl Walker {
    /// Returns the walk of person number `index` in the run of `seed`.
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
            let ends_s = begins_s + dx.hypotenuse(dy) / person.speed_mps;
            legs.push(Leg { from, to, begins_s, ends_s, heading: dy.atan2(dx) });
            time = ends_s;
        }
        let heading = legs.first().map_or(0.0, |l| l.heading);
        let rest = person.path_m.first().copied().unwrap_or_default();
        Self { person: person.clone(), legs, rest, heading, waits: Vec::new(), has_timed_out: false }
    }

    /// Returns the pose and posture `time_s` seconds after the start of the run.
    #[must_use]
    pub fn at(&self, time_s: f64) -> PersonPose {
        let pose = self.without_waits(time_s - self.waited_s(time_s));
        let waits = self.waits.iter().any(|[begin, end]| (*begin..*end).contains(&time_s));
        if waits { PersonPose { velocity: [0.0; 2], ..pose } } else { pose }
    }

    /// Waits from `from_s` to `to_s` (s after the start of the run) if the person gives way, a robot of this radius at `center`
    /// (m) is in the path, and the person has not yet waited for the maximum time, 30 s.
    pub fn give_way(&mut self, center: [f64; 2], radius_m: f64, from_s: f64, to_s: f64) {
        if self.person.gives_way_m <= 0.0 {
            return;
        }
        let PersonPose { at, velocity: [vx, vy], .. } = self.without_waits(from_s - self.waited_s(from_s));
        let speed = vx.hypotenuse(vy);
        if speed <= 0.0 {
            return;
        }
        let [dx, dy] = [center[0] - at[0], center[1] - at[1]];
        let (ahead, aside) = ((dx * vx + dy * vy) / speed, (dx * vy - dy * vx).abs() / speed);
        let touch = PERSON_RADIUS_M + radius_m;
        let gap = dx.hypotenuse(dy) - touch;
        if ahead <= 0.0 || aside > touch + LATERAL_CLEARANCE_M || gap > self.person.gives_way_m {
            self.has_timed_out = false;
            return;
        }
        if self.has_timed_out {
            return;
        }
        match self.waits.last_mut().filter(|last| last[1] >= from_s) {
            Some(last) => {
                last[1] = to_s;
                self.has_timed_out = to_s - last[0] >= MAX_WAIT_S;
            }
            None => self.waits.push([from_s, to_s]),
        }
    }

    /// Returns the total waiting time before `time_s`, s.
    fn waited_s(&self, time_s: f64) -> f64 {
        let waits = self.waits.iter().map(|[begin, end]| time_s.min(*end) - begin);
        waits.filter(|waited| *waited > 0.0).sum()
    }

    fn without_waits(&self, time_s: f64) -> PersonPose {
        let mut pose = PersonPose { at: self.rest, heading: self.heading, velocity: [0.0; 2], stride: 0.0 };
        for leg in self.legs.iter().take_while(|l| l.begins_s <= time_s) {
            let span = (leg.ends_s - leg.begins_s).max(1e-9);
            let share = ((time_s - leg.begins_s) / span).min(1.0);
            pose.heading = leg.heading;
            pose.at = [0, 1].map(|k| leg.from[k] + (leg.to[k] - leg.from[k]) * share);
            let walking = share < 1.0;
            pose.velocity = [0, 1].map(|k| if walking { (leg.to[k] - leg.from[k]) / span } else { 0.0 });
            let gone = (time_s - leg.begins_s).min(span) * self.person.speed_mps;
            let left = span * self.person.speed_mps - gone;
            let ease = (gone.min(left) / 0.3).min(1.0);
            pose.stride = MAX_STRIDE_M * ease * (std::f64::consts::TAU * gone / GAIT_M).sin();
        }
        pose
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
    fn a_person_waits_for_a_robot_in_the_path_and_walks_on() {
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
        // The person stops half a meter from the robot, until it leaves.
        let touch = PERSON_RADIUS_M + 0.2;
        let waited = walk(&person, [2.005, 0.0], 4.0);
        let stop = 2.005 - touch - 0.5;
        let pose = waited.at(3.0);
        assert!((pose.at[0] - stop).abs() < 0.02 && pose.velocity == [0.0; 2], "{pose:?}");
        // The past does not change, and the walk continues from there.
        assert!((waited.at(1.0).at[0] - 1.0).abs() < 1e-9 && waited.at(1.0).velocity == [1.0, 0.0]);
        assert!((waited.at(5.0).at[0] - stop - 1.0).abs() < 0.03, "{:?}", waited.at(5.0));
        // After the maximum wait, the person walks on.
        let timed_out = walk(&person, [2.005, 0.0], 50.0);
        let at = timed_out.at(stop + MAX_WAIT_S + 1.0);
        assert!((at.at[0] - stop - 1.0).abs() < 0.03, "{at:?}");
        // A robot beside the path or behind; and a person who does not give way.
        assert_eq!(walk(&person, [2.0, touch + 0.2], 10.0).at(3.0).at, [3.0, 0.0]);
        assert_eq!(walk(&person, [-0.5, 0.0], 10.0).at(3.0).at, [3.0, 0.0]);
        let unyielding = Person { gives_way_m: 0.0, ..person };
        assert_eq!(walk(&unyielding, [2.0, 0.0], 10.0).at(3.0).at, [3.0, 0.0]);
    }
}
