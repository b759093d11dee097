//! People and other things that cross the way, by what the camera saw come and by echoes that came suddenly near, and where they walk.

use nalgebra::Point2;
use yamabico_core::geometry::Pose2;

use super::stations::PathAhead;
use super::sudden_echo::SuddenEcho;

/// Length of the path ahead, and distance around it, within which the robot waits for what moves, m; and those within which it is followed.
const WAY_M: (f64, f64) = (1.9, 0.75);
const VIEW_M: (f64, f64) = (2.4, 1.5);
/// Number of cells in the way that were seen to become occupied from which something crosses, and below which it no longer
/// does: legs that pass, and turns of the robot, leave few of them. Number that tells where it is.
const COMES_CELLS: usize = 6;
const STAYS_CELLS: usize = 3;
const PLACE_CELLS: usize = 2;
/// Number of columns with an end of the floor where floor was seen from which they tell where legs are, and number of pictures in a row
/// that must show them; time and distance beside the path between two of these, s and m.
const LEGS_COLUMNS: usize = 3;
const LEGS_GLIMPSES: usize = 3;
const LEGS_S: f64 = 0.3;
const LEGS_STEP_M: f64 = 0.25;
/// Number of scans in a row that must hear something where floor was: single echoes may come over two reflections.
const HEARD_SCANS: usize = 3;
/// Time for which what crosses is taken to be there after it was seen last, and to be the same, s: legs hide each other.
const HOLD_S: f64 = 0.5;
const SAME_S: f64 = 3.0;
/// Distance beside the path over which something has moved to one side, m.
const WALKED_M: f64 = 0.15;

/// Record of what crosses the way.
#[derive(Clone, Debug, Default)]
pub(super) struct Crossing {
    echo: SuddenEcho,
    /// Number of the latest scans in a row that hear something in the way where floor was.
    heard_scans: usize,
    is_seen: bool,
    seen_s: Option<f64>,
    walk: Option<Walk>,
    legs: Option<Legs>,
}

/// Walk of what crosses. Places are measured to the left of the path, m.
#[derive(Clone, Copy, Debug)]
struct Walk {
    began_m: f64,
    at_m: f64,
    at_s: f64,
    /// Side to which it walks, 1 left, -1 right; 0 if that is not known.
    side: f64,
}

/// Legs in the last picture that showed some, m to the left of the path, and number of such pictures in a row.
#[derive(Clone, Copy, Debug)]
struct Legs {
    at_m: f64,
    at_s: f64,
    glimpses: usize,
}

/// Side of the path on which something walks on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walkway {
    /// Place of what walks, m to the left of the path.
    pub from_m: f64,
    /// Side to which it walks, 1 left, -1 right.
    pub side: f64,
}

impl Walkway {
    /// True if a lane (m to the left of the path) passes before what walks.
    #[must_use]
    pub fn is_before(&self, offset_m: f64) -> bool {
        self.side * (offset_m - self.from_m) > 0.0
    }
}

impl Crossing {
    /// Takes in the range ahead (m, infinite without an echo) that a robot at `pose` (odometry) measures at `now_s` (s).
    pub fn hear(&mut self, now_s: f64, range_m: f64, pose: Pose2) {
        self.echo.update(now_s, range_m, pose);
    }

    /// Takes in a place where a scan hears something and the camera saw floor a moment ago (robot frame, m); none if there is none.
    pub fn hear_step(&mut self, now_s: f64, path: &PathAhead, place: Option<Point2<f64>>) {
        let is_in_way = place.is_some_and(|place| path.is_near(place, WAY_M.0, WAY_M.1));
        self.heard_scans = if is_in_way { self.heard_scans + 1 } else { 0 };
        if self.heard_scans >= HEARD_SCANS {
            self.seen_s = Some(now_s);
        }
    }

    /// Takes in the places that something came to (robot frame, m); none if pictures do not tell.
    pub fn see(&mut self, now_s: f64, path: &PathAhead, places: impl Iterator<Item = Point2<f64>>) {
        let mut in_way = 0;
        let counted = places.inspect(|&place| in_way += usize::from(path.is_near(place, WAY_M.0, WAY_M.1)));
        if let Some(at_m) = mean_m(path, counted, PLACE_CELLS) {
            self.follow(now_s, at_m);
        }
        self.is_seen = in_way >= if self.is_seen { STAYS_CELLS } else { COMES_CELLS };
        if self.is_seen {
            self.seen_s = Some(now_s);
        }
    }

    /// Takes in the ends of the floor in a new picture at places that showed floor before (robot frame, m): legs that walk pass too fast to
    /// occupy them. Those of one picture may be noise.
    pub fn glimpse(&mut self, now_s: f64, path: &PathAhead, places: impl Iterator<Item = Point2<f64>>) {
        let Some(at_m) = mean_m(path, places, LEGS_COLUMNS) else { return };
        let is_next =
            |legs: &Legs| is_since(legs.at_s, LEGS_S, now_s) && (legs.at_m - at_m).abs() < LEGS_STEP_M;
        let glimpses = self.legs.filter(is_next).map_or(1, |legs| legs.glimpses + 1);
        self.legs = Some(Legs { at_m, at_s: now_s, glimpses });
        if glimpses >= LEGS_GLIMPSES {
            self.follow(now_s, at_m);
        }
    }

    fn follow(&mut self, now_s: f64, at_m: f64) {
        let new = Walk { began_m: at_m, at_m, at_s: now_s, side: 0.0 };
        let last = self.walk.filter(|walk| is_since(walk.at_s, SAME_S, now_s)).unwrap_or(new);
        let walked_m = at_m - last.began_m;
        let side = if walked_m.abs() > WALKED_M { walked_m.signum() } else { last.side };
        self.walk = Some(Walk { at_m, at_s: now_s, side, ..last });
    }

    /// True if something crosses the way.
    pub fn is_there(&self, now_s: f64) -> bool {
        self.seen_s.is_some_and(|at_s| is_since(at_s, HOLD_S, now_s)) || self.echo.moves(now_s)
    }

    /// Side of the path on which it walks on, if that is known.
    pub fn walkway(&self, now_s: f64) -> Option<Walkway> {
        let walk = self.walk.filter(|walk| walk.side != 0.0 && is_since(walk.at_s, SAME_S, now_s))?;
        Some(Walkway { from_m: walk.at_m, side: walk.side })
    }
}

/// Mean of `places` (robot frame, m) to the left of the path, m, if at least that many are near the path ahead.
fn mean_m(path: &PathAhead, places: impl Iterator<Item = Point2<f64>>, least: usize) -> Option<f64> {
    let in_view = places.filter(|&place| path.is_near(place, VIEW_M.0, VIEW_M.1));
    let (count, sum_m) =
        in_view.fold((0, 0.0), |(count, sum_m), place| (count + 1, sum_m + path.lateral_m_of(place)));
    (count >= least).then(|| sum_m / count as f64)
}

/// True within `length_s` seconds after `begin_s`.
fn is_since(begin_s: f64, length_s: f64, now_s: f64) -> bool {
    (0.0..length_s).contains(&(now_s - begin_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sees cells around a place 1 m ahead, `at_m` to the left of the path.
    fn see(crossing: &mut Crossing, now_s: f64, cells: usize, at_m: f64) {
        let places = (0..cells).map(|i| Point2::new(1.0 + 0.05 * i as f64, at_m));
        crossing.see(now_s, &PathAhead::default(), places);
    }

    #[test]
    fn what_has_come_crosses_until_hardly_anything_of_it_is_left() {
        let mut crossing = Crossing::default();
        for (now_s, cells, crosses) in [(0.0, 5, false), (0.1, 6, true), (2.0, 3, true), (4.0, 3, true)] {
            see(&mut crossing, now_s, cells, 0.0);
            assert_eq!(crossing.is_there(now_s), crosses, "{cells} cells at {now_s} s");
        }
        for (now_s, crosses) in [(4.4, true), (4.6, false), (3.9, false)] {
            see(&mut crossing, now_s, 2, 0.0);
            assert_eq!(crossing.is_there(now_s), crosses, "2 cells at {now_s} s");
        }
    }

    #[test]
    fn what_is_heard_where_floor_was_crosses_if_it_is_in_the_way_and_heard_again() {
        let mut crossing = Crossing::default();
        let beside = Point2::new(1.0, 1.2);
        for (now_s, place, crosses) in [
            (0.0, Some(beside), false),
            (0.1, Some(beside), false),
            (0.2, Some(beside), false),
            (0.3, Some(Point2::new(1.0, 0.4)), false),
            (0.4, None, false),
            (0.5, Some(Point2::new(1.0, 0.4)), false),
            (0.6, Some(Point2::new(1.0, 0.3)), false),
            (0.7, Some(Point2::new(1.0, 0.2)), true),
            (1.1, None, true),
            (1.3, None, false),
        ] {
            crossing.hear_step(now_s, &PathAhead::default(), place);
            assert_eq!(crossing.is_there(now_s), crosses, "at {now_s} s");
        }
    }

    #[test]
    fn what_moves_beside_the_way_is_not_waited_for() {
        let mut crossing = Crossing::default();
        see(&mut crossing, 0.0, 8, 1.2);
        assert!(!crossing.is_there(0.0));
    }

    #[test]
    fn what_walks_to_a_side_is_passed_on_the_other() {
        let mut crossing = Crossing::default();
        for i in 0..8 {
            let (now_s, at_m) = (0.1 * f64::from(i), 1.3 - 0.15 * f64::from(i));
            see(&mut crossing, now_s, 4, at_m);
            let walkway = crossing.walkway(now_s);
            assert_eq!(walkway.is_some(), i > 1, "{walkway:?} after {i} pictures");
        }
        // A pause, and a step back of the legs, do not change where it walks.
        see(&mut crossing, 2.0, 4, 0.3);
        let walkway = crossing.walkway(2.0).unwrap();
        assert_eq!(walkway, Walkway { from_m: 0.3, side: -1.0 });
        assert!(walkway.is_before(-0.3) && !walkway.is_before(0.6));
        assert_eq!(crossing.walkway(2.0 + SAME_S), None);
    }

    #[test]
    fn glimpses_of_legs_tell_where_they_walk_and_are_not_waited_for() {
        // Side to which legs walk whose columns are seen every so many seconds.
        let side = |columns: usize, every_s: f64| {
            let mut crossing = Crossing::default();
            for i in 0..8 {
                let (now_s, at_m) = (every_s * f64::from(i), 0.7 - 0.08 * f64::from(i));
                let places = (0..columns).map(|i| Point2::new(1.8, at_m + 0.02 * i as f64));
                crossing.glimpse(now_s, &PathAhead::default(), places);
                assert!(!crossing.is_there(now_s));
            }
            crossing.walkway(7.0 * every_s).map(|walkway| walkway.side)
        };
        assert_eq!(side(3, 0.1), Some(-1.0));
        assert_eq!(side(2, 0.1), None, "two columns may be noise");
        assert_eq!(side(3, 0.4), None, "so may single pictures");
    }

    #[test]
    fn what_stands_walks_nowhere() {
        let mut crossing = Crossing::default();
        for i in 0..20 {
            see(&mut crossing, 0.1 * f64::from(i), 4, if i % 2 == 0 { 0.4 } else { 0.48 });
            assert_eq!(crossing.walkway(0.1 * f64::from(i)), None);
        }
    }
}
