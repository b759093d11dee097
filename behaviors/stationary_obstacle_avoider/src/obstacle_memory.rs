//! Obstacles on the map, remembered while they are out of view.
//!
//! Differs from Ohya, Kosaka & Kak (1998), who assume that all obstacles stand one meter ahead: here they are located
//! by their foot on the floor, and stay on the map while the robot drives past. A place is remembered the longer, the
//! longer an obstacle was seen there, and what moves is soon forgotten: a person who crosses leaves no trail.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use yamabico_core::geometry::{Hypotenuse, Pose2};
use yamabico_core::time::Time;

/// Maximum number of remembered obstacles.
const MAX_OBSTACLES: usize = 24;
/// Time after which a seen obstacle is forgotten, s.
const SEEN_LIFETIME_S: f64 = 30.0;
/// Time after which a seen obstacle near the robot is forgotten, s: a standing robot gets no other view of it.
const NEARBY_LIFETIME_S: f64 = 120.0;
/// Distance from the robot within which an obstacle is near, m.
const NEARBY_M: f64 = 1.5;
/// Time for which an obstacle is remembered, per time that it was seen for.
const LIFETIME_PER_TIME_SEEN: f64 = 10.0;
/// Minimum time for which an obstacle is remembered, s.
const MIN_LIFETIME_S: f64 = 3.0;
/// Time after which an obstacle that moves is forgotten, s.
const MOVING_LIFETIME_S: f64 = 1.5;
/// Lateral displacement, as seen from the robot, from which on an obstacle moves, radii: more than the step from one image
/// region to the next.
const MOVING_RADII: f64 = 3.0;
/// Time after which an obstacle that has not moved any farther counts as stationary again, s.
const RESTING_S: f64 = 3.0;
/// Maximum angle between the robot's heading and a direction that a search looks in, rad.
const MAX_SEARCH_RAD: f64 = 1.2;
/// Time after which an obstacle known only by sonar is forgotten, s.
const ECHO_LIFETIME_S: f64 = 1.5;
/// Distance beyond the radius of a known obstacle up to which a detection is assigned to it, m.
const ASSIGNMENT_M: f64 = 0.3;
/// Number of consecutive frames that show the obstacle's place, but not the obstacle, after which it is forgotten.
const MAX_MISSES: u32 = 3;

/// Obstacle that the map does not contain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KnownObstacle {
    /// Center, m, map frame.
    #[serde(with = "place")]
    pub at: Point2<f64>,
    /// Radius, m.
    pub radius_m: f64,
    /// True if it was detected in two of three frames, or by sonar.
    pub is_confirmed: bool,
    /// Time of the last detection.
    pub seen: Time,
    /// Time of the first detection.
    first_seen: Time,
    /// True if it moves: a person, not a box.
    pub is_moving: bool,
    /// Position when it was first seen or last found to move (m, map frame), and the time of that.
    #[serde(with = "place")]
    anchor: Point2<f64>,
    anchored: Time,
    was_seen: bool,
    history: u8,
    misses: u32,
    is_fresh: bool,
}

impl KnownObstacle {
    fn new(at: Point2<f64>, radius_m: f64, now: Time) -> Self {
        Self {
            at,
            radius_m,
            is_confirmed: false,
            seen: now,
            first_seen: now,
            is_moving: false,
            anchor: at,
            anchored: now,
            was_seen: true,
            history: 0,
            misses: 0,
            is_fresh: true,
        }
    }

    /// Decides whether the obstacle moves, from its displacement across the line of sight from `from` (m, map frame): the
    /// distance along that line is uncertain.
    fn track(&mut self, from: Point2<f64>, now: Time) {
        let sight = self.at - from;
        let across_m = sight.perp(&(self.at - self.anchor)).abs() / sight.norm().max(1e-3);
        let is_displaced = across_m > MOVING_RADII * self.radius_m;
        let is_over = now.seconds_after(self.anchored) > RESTING_S;
        if is_displaced || is_over {
            self.is_moving = is_displaced && !is_over;
            (self.anchor, self.anchored) = (self.at, now);
        }
    }

    /// Returns the time after the last detection for which the obstacle is remembered by a robot at `robot` (m, map frame), s.
    #[must_use]
    pub fn lifetime_s(&self, robot: Option<Point2<f64>>) -> f64 {
        let is_beside = robot.is_some_and(|robot| (self.at - robot).norm() < NEARBY_M);
        let seen_s = self.seen.seconds_after(self.first_seen);
        let lifetime_s = (LIFETIME_PER_TIME_SEEN * seen_s).max(MIN_LIFETIME_S);
        match (self.was_seen, is_beside) {
            _ if self.is_moving => MOVING_LIFETIME_S,
            (true, true) => lifetime_s.min(NEARBY_LIFETIME_S),
            (true, false) => lifetime_s.min(SEEN_LIFETIME_S),
            (false, _) => ECHO_LIFETIME_S,
        }
    }

    /// Returns true if a robot of `half_width_m` that drives `length_m` from `pose` in direction `bearing` (rad) touches
    /// the obstacle. One behind the robot does not count.
    fn is_on_line(&self, pose: &Pose2, bearing: f64, length_m: f64, half_width_m: f64) -> bool {
        let (sin, cos) = bearing.sin_cos();
        let at = pose.inverse().transform_point(self.at);
        let (along, across) = (cos * at.x + sin * at.y, cos * at.y - sin * at.x);
        let nearest = across.hypotenuse(along - along.clamp(0.0, length_m));
        along > 0.0 && nearest < self.radius_m + half_width_m
    }
}

/// Image border that cuts a detected obstacle off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Border {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl Border {
    /// Combines a known position with that of a visible remainder, seen from `from`: the result is no farther away, and no
    /// farther into the image, than either of them.
    fn place(self, from: Point2<f64>, known: Point2<f64>, seen: Point2<f64>) -> Point2<f64> {
        let (known, seen) = (known - from, seen - from);
        let is_known_farther_left = seen.perp(&known) > 0.0;
        let towards = if is_known_farther_left == (self == Border::Left) { known } else { seen };
        from + towards.cap_magnitude(known.norm().min(seen.norm()))
    }
}

/// All known obstacles.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ObstacleMemory {
    list: Vec<KnownObstacle>,
    /// Number of frames since the memory was last reset.
    frames: u32,
}

impl Default for ObstacleMemory {
    fn default() -> Self {
        Self { list: Vec::with_capacity(MAX_OBSTACLES), frames: 0 }
    }
}

impl ObstacleMemory {
    /// Returns all obstacles, confirmed or not.
    #[must_use]
    pub fn all(&self) -> &[KnownObstacle] {
        &self.list
    }

    /// Returns the confirmed obstacles: the ones that are avoided and published.
    pub fn confirmed(&self) -> impl Iterator<Item = &KnownObstacle> {
        self.list.iter().filter(|obstacle| obstacle.is_confirmed)
    }

    /// Forgets the obstacles that may have left, before a new search: all but the seen ones that are near `robot`
    /// (map frame) and in no direction that a search looks in.
    pub fn forget_ahead(&mut self, robot: Option<Pose2>) {
        let is_out_of_view = |obstacle: &KnownObstacle| {
            robot.is_some_and(|robot| {
                let at = robot.inverse().transform_point(obstacle.at);
                at.coords.norm() < NEARBY_M && at.y.atan2(at.x).abs() > MAX_SEARCH_RAD
            })
        };
        self.list.retain(|obstacle| obstacle.was_seen && is_out_of_view(obstacle));
        self.frames = 0;
    }

    /// Returns true after two frames, the minimum for an obstacle in view to be confirmed.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.frames >= 2
    }

    /// Starts the detections of a frame.
    pub fn begin_frame(&mut self) {
        for obstacle in &mut self.list {
            obstacle.is_fresh = false;
        }
    }

    /// Adds a detection at `at` (m, map frame) in the current frame, captured at `from` (m, map frame). `cut`: the border
    /// of the image, if it cuts the obstacle off.
    pub fn add_detection(
        &mut self,
        at: Point2<f64>,
        radius_m: f64,
        from: Point2<f64>,
        cut: Option<Border>,
        now: Time,
    ) {
        let is_same = |obstacle: &KnownObstacle| {
            (obstacle.at - at).norm() < obstacle.radius_m.max(radius_m) + ASSIGNMENT_M
        };
        let known = self.list.iter_mut().filter(|obstacle| !obstacle.is_fresh && is_same(obstacle));
        let nearest = known.min_by(|a, b| (a.at - at).norm().total_cmp(&(b.at - at).norm()));
        if let Some(obstacle) = nearest {
            obstacle.at = cut.map_or(at, |cut| cut.place(from, obstacle.at, at));
            (obstacle.radius_m, obstacle.seen, obstacle.misses) = (radius_m, now, 0);
            (obstacle.was_seen, obstacle.is_fresh) = (true, true);
            if cut.is_none() {
                obstacle.track(from, now);
            }
        } else if self.list.len() < MAX_OBSTACLES {
            self.list.push(KnownObstacle::new(at, radius_m, now));
        }
    }

    /// Adds an obstacle detected by sonar at `at` (m, map frame); it is confirmed at once.
    pub fn add_echo(&mut self, at: Point2<f64>, radius_m: f64, now: Time) {
        if let Some(obstacle) =
            self.list.iter_mut().find(|obstacle| (obstacle.at - at).norm() < obstacle.radius_m)
        {
            (obstacle.is_confirmed, obstacle.seen) = (true, now);
            return;
        }
        if self.list.len() < MAX_OBSTACLES {
            let new = KnownObstacle::new(at, radius_m, now);
            self.list.push(KnownObstacle { is_confirmed: true, was_seen: false, ..new });
        }
    }

    /// Ends the detections of a frame. `is_in_view` returns true for a position (map frame) that the frame shows.
    pub fn end_frame(&mut self, is_in_view: impl Fn(Point2<f64>) -> bool) {
        self.frames = self.frames.saturating_add(1);
        for obstacle in &mut self.list {
            if !obstacle.is_fresh && !is_in_view(obstacle.at) {
                continue;
            }
            obstacle.history = obstacle.history << 1 | u8::from(obstacle.is_fresh);
            obstacle.misses = if obstacle.is_fresh { 0 } else { obstacle.misses + 1 };
            obstacle.is_confirmed |= (obstacle.history & 0b111).count_ones() >= 2;
        }
        self.list.retain(|obstacle| obstacle.misses < MAX_MISSES);
    }

    /// Forgets obstacles that were not detected for too long. `robot` is its position, m, map frame.
    pub fn expire(&mut self, now: Time, robot: Option<Point2<f64>>) {
        self.list.retain(|obstacle| now.seconds_after(obstacle.seen) <= obstacle.lifetime_s(robot));
    }

    /// Returns true if an obstacle that moves is in the way of a robot of `half_width_m` that drives `length_m` from `pose`
    /// in direction `bearing` (rad, relative to its heading).
    #[must_use]
    pub fn is_crossed(&self, pose: &Pose2, bearing: f64, length_m: f64, half_width_m: f64) -> bool {
        let mut moving = self.confirmed().filter(|obstacle| obstacle.is_moving);
        moving.any(|obstacle| obstacle.is_on_line(pose, bearing, length_m, half_width_m))
    }

    /// Returns true if a robot of `half_width_m` that drives `length_m` from `pose` in direction `bearing` (rad,
    /// relative to its heading) touches no confirmed obstacle. Obstacles behind the robot do not count, so that it
    /// can leave one it stands too close to.
    #[must_use]
    pub fn is_free(&self, pose: &Pose2, bearing: f64, length_m: f64, half_width_m: f64) -> bool {
        self.confirmed().all(|obstacle| !obstacle.is_on_line(pose, bearing, length_m, half_width_m))
    }
}

/// Serialization of a point as its two coordinates.
mod place {
    use nalgebra::Point2;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(place: &Point2<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        [place.x, place.y].serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Point2<f64>, D::Error> {
        <[f64; 2]>::deserialize(deserializer).map(Point2::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(obstacles: &mut ObstacleMemory, x: f64) {
        obstacles.begin_frame();
        obstacles.add_detection(Point2::new(x, 0.0), 0.2, Point2::origin(), None, Time::ZERO);
        obstacles.end_frame(|_| true);
    }

    /// Detects an obstacle at y for `seconds`, ten times a second, while it moves at `speed_mps`.
    fn watch(obstacles: &mut ObstacleMemory, y: f64, speed_mps: f64, seconds: f64) {
        for i in 0..=(10.0 * seconds) as u32 {
            let now_s = 0.1 * f64::from(i);
            let at = Point2::new(2.0, y + speed_mps * now_s);
            obstacles.begin_frame();
            obstacles.add_detection(at, 0.2, Point2::origin(), None, Time::from_secs_f64(now_s));
            obstacles.end_frame(|_| false);
        }
    }

    #[test]
    fn one_who_crosses_is_waited_for_and_soon_forgotten_and_a_box_is_not() {
        for (speed_mps, moves) in [(1.0, true), (-0.6, true), (0.1, false), (0.0, false)] {
            let mut obstacles = ObstacleMemory::default();
            watch(&mut obstacles, -0.5 * speed_mps * 2.0, speed_mps, 2.0);
            let crossed = obstacles.is_crossed(&Pose2::new(0.0, speed_mps, 0.0), 0.0, 3.0, 0.2);
            assert_eq!(crossed, moves, "at {speed_mps} m/s");
            obstacles.expire(Time::from_secs_f64(4.0), Some(Point2::new(1.0, 0.0)));
            assert_eq!(obstacles.all().is_empty(), moves, "at {speed_mps} m/s");
        }
        let mut resting = ObstacleMemory::default();
        watch(&mut resting, -1.0, 1.0, 1.0);
        assert!(resting.confirmed().all(|obstacle| obstacle.is_moving));
        for i in 11..50 {
            resting.begin_frame();
            let now = Time::from_secs_f64(0.1 * f64::from(i));
            resting.add_detection(Point2::new(2.0, 0.0), 0.2, Point2::origin(), None, now);
            resting.end_frame(|_| false);
        }
        assert!(resting.confirmed().all(|obstacle| !obstacle.is_moving), "it has come to rest");
    }

    #[test]
    fn a_glimpse_is_forgotten_sooner_than_a_long_look() {
        for (seconds, remembered_s) in [(0.2, 3.0), (1.0, 10.0), (5.0, 30.0)] {
            let mut obstacles = ObstacleMemory::default();
            watch(&mut obstacles, 0.0, 0.0, seconds);
            let mut left_after = |age_s: f64| {
                obstacles.expire(Time::from_secs_f64(seconds + age_s), None);
                obstacles.confirmed().count()
            };
            assert_eq!(
                [left_after(remembered_s - 0.2), left_after(remembered_s + 0.2)],
                [1, 0],
                "{seconds} s"
            );
        }
    }

    #[test]
    fn detection_in_two_of_three_frames_confirms_and_three_misses_remove() {
        let mut obstacles = ObstacleMemory::default();
        seen(&mut obstacles, 2.0);
        assert_eq!(obstacles.confirmed().count(), 0);
        obstacles.begin_frame();
        obstacles.end_frame(|_| true);
        seen(&mut obstacles, 2.1);
        assert_eq!(obstacles.confirmed().count(), 1);
        for _ in 0..5 {
            obstacles.begin_frame();
            obstacles.end_frame(|_| false);
        }
        assert_eq!(obstacles.confirmed().count(), 1, "obstacles out of view must be kept");
        for _ in 0..3 {
            obstacles.begin_frame();
            obstacles.end_frame(|_| true);
        }
        assert!(obstacles.all().is_empty());
    }

    #[test]
    fn an_obstacle_cut_by_the_image_border_moves_neither_farther_away_nor_farther_in() {
        let mut obstacles = ObstacleMemory::default();
        seen(&mut obstacles, 2.0);
        let (from, left, right) = (Point2::new(1.0, 0.0), Some(Border::Left), Some(Border::Right));
        for (at, cut, there) in [
            ([2.3, 0.0], left, [2.0, 0.0]),
            ([1.9, 0.0], left, [1.9, 0.0]),
            ([1.9, -0.1], left, [1.9, 0.0]),
            ([1.9, 0.1], left, [1.9, 0.1]),
            ([1.9, 0.2], right, [1.9, 0.1]),
            ([2.1, 0.2], None, [2.1, 0.2]),
        ] {
            obstacles.begin_frame();
            obstacles.add_detection(Point2::from(at), 0.15, from, cut, Time::ZERO);
            obstacles.end_frame(|_| true);
            let off = (obstacles.confirmed().next().unwrap().at - Point2::from(there)).norm();
            assert!(off < 0.015, "{at:?}: {off} m from {there:?}");
        }
        obstacles.begin_frame();
        obstacles.add_detection(Point2::new(3.5, 0.0), 0.15, from, left, Time::ZERO);
        assert_eq!(obstacles.all().len(), 2, "a new obstacle is placed where it was detected");
    }

    #[test]
    fn the_path_past_a_thing_is_free_and_the_way_into_it_is_not() {
        let mut obstacles = ObstacleMemory::default();
        seen(&mut obstacles, 1.5);
        seen(&mut obstacles, 1.5);
        let free = |bearing: f64| obstacles.is_free(&Pose2::IDENTITY, bearing, 2.0, 0.23);
        assert!(!free(0.0) && !free(0.2) && free(0.35) && free(-0.35));
        let beside = Pose2::new(1.5, 0.45, 0.0);
        assert!(
            obstacles.is_free(&beside, 0.0, 2.0, 0.23)
                && !obstacles.is_free(&Pose2::new(1.3, 0.6, 0.0), -1.2, 2.0, 0.23)
        );
    }

    #[test]
    fn obstacles_expire_and_those_near_the_robot_later() {
        let mut obstacles = ObstacleMemory::default();
        obstacles.add_echo(Point2::new(0.5, 0.0), 0.1, Time::ZERO);
        watch(&mut obstacles, 0.0, 0.0, 13.0);
        let mut left = |seconds: f64, robot_x: f64| {
            obstacles.expire(Time::from_secs_f64(seconds), Some(Point2::new(robot_x, 0.0)));
            obstacles.confirmed().count()
        };
        assert_eq!([left(1.4, 0.0), left(1.6, 0.0)], [2, 1]);
        assert_eq!([left(42.0, 0.0), left(132.0, 1.0), left(132.0, 0.0)], [1, 1, 0]);
        watch(&mut obstacles, 0.0, 0.0, 13.0);
        obstacles.expire(Time::from_secs_f64(134.0), Some(Point2::new(1.0, 0.0)));
        assert!(obstacles.all().is_empty());
    }

    #[test]
    fn a_new_search_forgets_all_but_seen_obstacles_beside_the_robot() {
        let mut obstacles = ObstacleMemory::default();
        for x in [1.0, 3.0] {
            obstacles.begin_frame();
            obstacles.add_detection(Point2::new(x, 0.0), 0.2, Point2::origin(), None, Time::ZERO);
            obstacles.end_frame(|_| false);
        }
        obstacles.add_echo(Point2::new(0.0, 1.0), 0.1, Time::ZERO);
        obstacles.forget_ahead(Some(Pose2::new(1.0, -0.5, 0.0)));
        assert_eq!(
            obstacles.all().iter().map(|obstacle| obstacle.at).collect::<Vec<_>>(),
            [Point2::new(1.0, 0.0)]
        );
        let settled = [(); 3].map(|()| {
            let is_settled = obstacles.is_settled();
            obstacles.begin_frame();
            obstacles.end_frame(|_| false);
            is_settled
        });
        assert_eq!(settled, [false, false, true], "one frame must not confirm");
        obstacles.forget_ahead(None);
        assert!(obstacles.all().is_empty());
    }
}
