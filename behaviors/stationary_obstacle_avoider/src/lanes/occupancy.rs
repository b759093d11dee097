//! Evidence around the robot: log odds that a place is occupied, in cells of the odometry frame that roll along with the
//! robot.
//!
//! Moravec & Elfes (1985).

use nalgebra::{Point2, Vector2};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::Beam;
use yamabico_vision::rolling_window::RollingWindow;

use super::arrivals::Arrivals;
use super::beam_cone::BeamCone;
use super::dark_things::DarkThings;
pub use super::evidence_layer::Evidence;
use super::evidence_layer::Layer;
use super::fading;
use super::seen_floor::SeenFloor;

/// Side of a cell, m.
pub const CELL_M: f64 = 0.05;
/// Cells on each side of the window: the robot sees 3.2 m in each direction.
const CELLS: usize = 128;
/// Log odds from which a cell is occupied: the sum of all kinds of evidence.
const OCCUPIED: f32 = 2.0;
/// Limits of the log odds by the floor's look, by geometry, and by the sonars.
const LOOK_LIMITS: (f32, f32) = (-2.0, 6.0);
const GEOMETRY_LIMITS: (f32, f32) = (-1.0, 6.0);
const SONAR_LIMITS: (f32, f32) = (-6.0, 6.0);
/// Part of the geometry that sonars can outvote: smooth surfaces at an angle give no echo.
const GEOMETRY_IN_DOUBT: f32 = 2.0;
/// Log odds by the look at which a cell is surely floor.
const FLOOR_SEEN: f32 = -1.3;
/// Distance from the robot's center up to which what is remembered is not doubted, m: the camera sees what is farther away before the
/// robot is there. Log odds that remain of each kind of evidence by the camera: one or two pictures confirm it.
const UNDOUBTED_M: f64 = 0.6;
const IN_DOUBT: f32 = 0.5;

/// Log odds of the cells in a window around the robot.
#[derive(Clone, Debug)]
pub struct OccupancyGrid {
    window: RollingWindow,
    look: Layer,
    upright: Layer,
    motion: Layer,
    sonar: Layer,
    ground: SeenFloor,
    /// Cells in which the look has shown a thing since they entered the window.
    looked_raised: Vec<bool>,
    dark: DarkThings,
    arrivals: Arrivals,
}

impl Default for OccupancyGrid {
    fn default() -> Self {
        Self {
            window: RollingWindow::new(CELLS, CELL_M),
            look: Layer::new(CELLS * CELLS, LOOK_LIMITS),
            upright: Layer::new(CELLS * CELLS, GEOMETRY_LIMITS),
            motion: Layer::new(CELLS * CELLS, GEOMETRY_LIMITS),
            sonar: Layer::new(CELLS * CELLS, SONAR_LIMITS),
            ground: SeenFloor::new(CELLS * CELLS),
            looked_raised: vec![false; CELLS * CELLS],
            dark: DarkThings::new(CELLS * CELLS),
            arrivals: Arrivals::new(CELLS * CELLS),
        }
    }
}

impl OccupancyGrid {
    /// Moves the window to a robot at `position` (odometry frame, m), and fades all evidence by `dt_s` seconds; `is_in_view`
    /// is true for places that the camera sees.
    pub fn advance(&mut self, position: Point2<f64>, dt_s: f64, is_in_view: impl Fn(Point2<f64>) -> bool) {
        let Self { window, look, upright, motion, sonar, ground, looked_raised, dark, arrivals } = self;
        window.advance(position, |slot| {
            for layer in [&mut *look, upright, motion, sonar] {
                layer.odds[slot] = 0.0;
            }
            ground.clear(slot);
            looked_raised[slot] = false;
            dark.clear(slot);
            arrivals.clear(slot);
        });
        let dt_s = dt_s.clamp(0.0, 60.0);
        arrivals.advance(dt_s);
        let elapsed_s = dt_s as f32;
        let is_unseen = |slot: usize| !is_in_view(window.place(slot));
        for layer in [look, upright, motion] {
            let stays = |slot: usize| !arrivals.has_come(slot) && is_unseen(slot);
            layer.fade(|slot, odds| elapsed_s * fading::camera_per_s(odds, || stays(slot)));
        }
        let distance_m = |slot: usize| (window.place(slot) - position).norm();
        sonar.fade(|slot, odds| {
            elapsed_s * fading::sonar_per_s(odds, || distance_m(slot) < fading::BESIDE_M && is_unseen(slot))
        });
    }

    /// Takes what is within `radius_m` (m) of `position` (odometry frame, m) for floor until something else is seen there.
    pub fn presume_floor(&mut self, position: Point2<f64>, radius_m: f64) {
        let Self { window, ground, .. } = self;
        let near = (0..CELLS * CELLS).filter(|&slot| (window.place(slot) - position).norm() < radius_m);
        near.for_each(|slot| ground.presume(slot));
    }

    /// Doubts what the camera has seen, and takes what it has not for floor, but for what is near to a robot at `position` (odometry
    /// frame, m).
    pub fn doubt(&mut self, position: Point2<f64>) {
        let Self { window, look, upright, motion, ground, .. } = self;
        for slot in (0..CELLS * CELLS).filter(|&slot| (window.place(slot) - position).norm() > UNDOUBTED_M) {
            for layer in [&mut *look, upright, motion] {
                layer.odds[slot] = layer.odds[slot].min(IN_DOUBT);
            }
            ground.presume(slot);
        }
    }

    /// Adds `evidence` (log odds) of the camera to the cells at `places` (odometry frame, m), once to each cell.
    pub fn add(&mut self, kind: Evidence, places: impl Iterator<Item = Point2<f64>>, evidence: f32) {
        let layer = match kind {
            Evidence::Look => &mut self.look,
            Evidence::Upright => &mut self.upright,
            Evidence::Motion => &mut self.motion,
        };
        layer.begin();
        self.ground.begin();
        for slot in places.filter_map(|place| self.window.slot(place)) {
            layer.add_to(slot, evidence);
            self.ground.add_to(slot, evidence);
        }
    }

    /// Adds what looks like floor at `places` (odometry frame, m), as `evidence` (log odds); where that is true, floor was seen. A thing of
    /// the floor's color looks like floor, too: where motion alone has shown one, it stays.
    pub fn add_floor(&mut self, places: impl Iterator<Item = (Point2<f64>, bool)>, evidence: f32) {
        let Self { window, look, upright, motion, ground, looked_raised, dark, .. } = self;
        for layer in [&mut *look, upright, motion] {
            layer.begin();
        }
        ground.begin();
        for (place, is_seen) in places {
            let Some(slot) = window.slot(place) else { continue };
            look.add_to(slot, evidence);
            if look.odds[slot] <= 0.0 {
                dark.clear(slot);
            }
            upright.add_to(slot, evidence);
            if is_seen {
                ground.add_to(slot, evidence);
            }
            if looked_raised[slot] {
                motion.add_to(slot, evidence);
            }
        }
    }

    /// Adds what looks like a thing at `places` (odometry frame, m), as `evidence` (log odds); where that is true, it is darker than the
    /// floor.
    pub fn add_thing(&mut self, places: impl Iterator<Item = (Point2<f64>, bool)>, evidence: f32) {
        self.look.begin();
        self.ground.begin();
        for (place, is_darker) in places {
            for slot in neighbors(place).filter_map(|place| self.window.slot(place)) {
                self.looked_raised[slot] = true;
            }
            if let Some(slot) = self.window.slot(place) {
                self.look.add_to(slot, evidence);
                self.ground.add_to(slot, evidence);
                self.dark.add_to(slot, is_darker);
            }
        }
    }

    /// Adds a beam of a scan taken at `robot` (odometry frame): the cone before the echo is free, its arc is occupied at
    /// places that are `counted`.
    pub fn add_beam(&mut self, beam: &Beam, robot: &Pose2, counted: impl Fn(Point2<f64>) -> bool) {
        let echo_m = beam.echo_m().unwrap_or(f64::INFINITY);
        let Some(cone) = BeamCone::new(beam, robot).filter(|_| echo_m > 0.0) else {
            return;
        };
        let (free, free_odds) = cone.free(echo_m, CELL_M);
        if echo_m.is_finite() {
            self.sonar.add(&self.window, free, free_odds);
        } else {
            self.sonar.lower(&self.window, free, free_odds, |slot| self.dark.silence_limit(slot));
        }
        if BeamCone::marks(beam, echo_m) {
            let arc = || cone.arc(echo_m).filter(|&place| counted(place));
            // An echo says that something is on its arc, not that all of it is occupied: what is known to stand there
            // explains it.
            let mut known = [None; 9 * BeamCone::ARC];
            let near = arc().flat_map(neighbors).filter(|&place| self.is_occupied(place));
            known.iter_mut().zip(near).for_each(|(known, place)| *known = Some(place));
            if known[0].is_some() {
                self.sonar.add(&self.window, known.into_iter().flatten(), BeamCone::ECHO);
            } else {
                self.sonar.add(&self.window, arc(), BeamCone::ECHO);
            }
        }
    }

    /// Takes note of what has come since the last picture; unless `is_sure`, it may be a mirror image where it gives no echo.
    pub fn update_arrivals(&mut self, is_sure: bool) {
        let Self { window, look, upright, motion, sonar, arrivals, .. } = self;
        let is_occupied = |slot: usize| total([look, upright, motion, sonar], slot) >= OCCUPIED;
        let is_floor = |slot: usize| look.odds[slot] <= FLOOR_SEEN;
        arrivals.update(window, is_occupied, is_floor, |slot| is_sure || upright.odds[slot] > 0.0);
    }

    /// True if what occupies a place (odometry frame, m) came there some seconds ago at most, and is no mirror image.
    pub fn moves(&self, place: Point2<f64>) -> bool {
        self.window.slot(place).is_some_and(|slot| self.arrivals.moves(slot))
    }

    /// True if a place (odometry frame, m) showed floor so lately that what a sonar hears there has come.
    pub fn was_floor(&self, place: Point2<f64>) -> bool {
        self.window.slot(place).is_some_and(|slot| self.arrivals.was_floor(&self.window, slot))
    }

    /// True if the last pictures show floor at a place (odometry frame, m), and nothing stands beside it: an end of the floor there comes.
    pub fn is_free_floor(&self, place: Point2<f64>) -> bool {
        self.window.slot(place).is_some_and(|slot| {
            self.look.odds[slot] <= FLOOR_SEEN && !self.arrivals.is_beside_what_stands(&self.window, slot)
        })
    }

    fn sum(&self, slot: usize) -> f32 {
        total([&self.look, &self.upright, &self.motion, &self.sonar], slot)
    }

    /// True if geometry alone makes a place occupied, odometry frame, m.
    pub fn is_upright(&self, place: Point2<f64>) -> bool {
        let is_certain =
            |slot: usize| self.upright.odds[slot].max(self.motion.odds[slot]) - GEOMETRY_IN_DOUBT >= OCCUPIED;
        self.window.slot(place).is_some_and(is_certain)
    }

    /// True if the camera has seen floor at a place (odometry frame, m), however long ago, and nothing else since.
    pub fn shows_floor(&self, place: Point2<f64>) -> bool {
        self.window.slot(place).is_some_and(|slot| self.ground.is_seen(slot))
    }

    /// True if a place (odometry frame, m) was seen as floor, or is taken for it.
    pub fn is_taken_for_floor(&self, place: Point2<f64>) -> bool {
        self.window.slot(place).is_some_and(|slot| self.ground.is_taken(slot))
    }

    fn is_occupied(&self, place: Point2<f64>) -> bool {
        self.window.slot(place).is_some_and(|slot| self.sum(slot) >= OCCUPIED)
    }

    /// Middles of the occupied cells, odometry frame, m.
    pub fn occupied(&self) -> impl Iterator<Item = Point2<f64>> {
        let cells = (0..CELLS * CELLS).filter(|&slot| self.sum(slot) >= OCCUPIED);
        cells.map(|slot| self.window.place(slot))
    }
}

/// Sum of all evidence of a cell by look, upright edges, motion and sonars: the sonars cannot outvote what geometry established.
fn total(layers: [&Layer; 4], slot: usize) -> f32 {
    let [look, upright, motion, sonar] = layers.map(|layer| layer.odds[slot]);
    let certain = (upright.max(motion) - GEOMETRY_IN_DOUBT).max(0.0);
    let geometry = (upright + motion).clamp(GEOMETRY_LIMITS.0, GEOMETRY_LIMITS.1);
    (look + geometry + sonar).max(certain)
}

/// Places in the cell of `place` and in the eight around it.
pub(super) fn neighbors(place: Point2<f64>) -> impl Iterator<Item = Point2<f64>> {
    const STEPS: [f64; 3] = [-CELL_M, 0.0, CELL_M];
    STEPS.into_iter().flat_map(move |x| STEPS.map(|y| place + Vector2::new(x, y)))
}

#[cfg(test)]
mod tests {
    use yamabico_core::geometry::Hypotenuse;

    use super::*;
    use yamabico_core::message::NO_ECHO;

    fn occupied(grid: &OccupancyGrid) -> Vec<Point2<f64>> {
        grid.occupied().collect()
    }

    #[test]
    fn evidence_counts_once_an_update_and_fades() {
        let mut grid = OccupancyGrid::default();
        let place = Point2::new(1.02, -0.33);
        grid.add(Evidence::Look, [place; 20].into_iter(), 1.3);
        assert!(occupied(&grid).is_empty(), "one picture is not enough");
        grid.add(Evidence::Look, [place].into_iter(), 1.3);
        let found = occupied(&grid);
        assert_eq!(found.len(), 1);
        assert!((found[0] - place).norm() < CELL_M);
        grid.advance(Point2::origin(), 1.0, |_| true);
        assert!(occupied(&grid).is_empty(), "one second later it is forgotten");
    }

    #[test]
    fn free_floor_is_what_was_seen_beside_nothing_that_stands() {
        let mut grid = OccupancyGrid::default();
        let (thing, beside, away) =
            (Point2::new(1.52, 0.03), Point2::new(1.42, 0.03), Point2::new(1.22, 0.03));
        (0..3).for_each(|_| grid.add_thing([(thing, false)].into_iter(), 1.3));
        assert!(!grid.is_free_floor(away), "it was not seen");
        (0..3).for_each(|_| grid.add_floor([(beside, true), (away, true)].into_iter(), -0.7));
        grid.update_arrivals(true);
        assert!(grid.is_free_floor(away) && !grid.is_free_floor(beside) && !grid.is_free_floor(thing));
    }

    #[test]
    fn what_is_doubted_must_be_seen_again_unless_it_is_near() {
        let mut grid = OccupancyGrid::default();
        let (near, far) = (Point2::new(0.4, 0.1), Point2::new(1.3, -0.2));
        for kind in [Evidence::Look, Evidence::Upright, Evidence::Motion] {
            for _ in 0..6 {
                grid.add(kind, [near, far].into_iter(), 1.3);
            }
        }
        grid.doubt(Point2::origin());
        let found = occupied(&grid);
        assert!(found.len() == 1 && (found[0] - near).norm() < CELL_M, "{found:?}");
        grid.add(Evidence::Look, [far].into_iter(), 1.3);
        assert_eq!(occupied(&grid).len(), 2, "a picture confirms it");
    }

    #[test]
    fn what_may_be_a_wall_of_the_floors_color_clears_a_look_and_is_no_floor_that_was_seen() {
        let mut grid = OccupancyGrid::default();
        let place = Point2::new(1.52, 0.03);
        (0..3).for_each(|_| grid.add_thing([(place, false)].into_iter(), 1.3));
        assert_eq!(occupied(&grid).len(), 1);
        (0..6).for_each(|_| grid.add_floor([(place, false)].into_iter(), -0.7));
        assert!(occupied(&grid).is_empty() && !grid.shows_floor(place));
        (0..6).for_each(|_| grid.add_floor([(place, true)].into_iter(), -0.7));
        assert!(grid.shows_floor(place));
    }

    #[test]
    fn cells_stay_where_they_are_while_the_window_rolls() {
        let mut grid = OccupancyGrid::default();
        let place = Point2::new(2.01, 0.57);
        for _ in 0..5 {
            grid.add(Evidence::Look, [place].into_iter(), 1.3);
        }
        for step in 0..40 {
            grid.advance(Point2::new(0.1 * f64::from(step), -0.03 * f64::from(step)), 0.0, |_| true);
            let found = occupied(&grid);
            assert!(found.len() == 1 && (found[0] - place).norm() < CELL_M, "step {step}: {found:?}");
        }
        grid.advance(Point2::new(9.0, 0.0), 0.0, |_| true);
        grid.advance(Point2::new(3.0, 0.0), 0.0, |_| true);
        assert!(occupied(&grid).is_empty(), "what left the window is forgotten");
    }

    #[test]
    fn an_echo_of_a_known_obstacle_does_not_widen_it() {
        let mut grid = OccupancyGrid::default();
        for _ in 0..3 {
            grid.add(Evidence::Look, [Point2::new(0.98, -0.17)].into_iter(), 1.3);
        }
        let beam = Beam { cone_rad: 0.6, range_m: 1.0, ..Beam::default() };
        for _ in 0..20 {
            grid.add_beam(&beam, &Pose2::IDENTITY, |_| true);
        }
        let found = occupied(&grid);
        assert!(found.iter().all(|place| place.y < -0.05) && !found.is_empty(), "{found:?}");
    }

    #[test]
    fn echoes_mark_their_arc_and_clear_their_cone() {
        let beam =
            |range_m: f64, flags: u32| Beam { cone_rad: 0.4, range_m, x_m: 0.2, flags, ..Beam::default() };
        let (mut grid, robot) = (OccupancyGrid::default(), Pose2::new(0.0, 0.0, 0.5));
        (0..2).for_each(|_| grid.add_beam(&beam(1.0, 0), &robot, |_| true));
        let found = occupied(&grid);
        assert!(found.len() >= 3, "{found:?}");
        for place in found {
            let seen = robot.inverse().transform_point(place);
            assert!(((seen.x - 0.2).hypotenuse(seen.y) - 1.0).abs() < 0.06 && seen.y.abs() < 0.2, "{seen:?}");
        }
        (0..12).for_each(|_| grid.add_beam(&beam(2.0, NO_ECHO), &robot, |_| true));
        assert!(occupied(&grid).is_empty());
        for bad in [beam(f64::NAN, 0), beam(-1.0, 0), beam(1.0, 0)] {
            grid.add_beam(&Beam { cone_rad: f64::NAN, ..bad }, &robot, |_| true);
        }
        grid.add(Evidence::Look, [Point2::new(f64::NAN, 0.0)].into_iter(), 5.0);
        assert!(occupied(&grid).is_empty());
    }

    #[test]
    fn silent_sonars_outvote_the_look_but_not_the_geometry() {
        let place = Point2::new(0.52, 0.03);
        let is_kept = |kind: Evidence, pictures: usize| {
            let mut grid = OccupancyGrid::default();
            (0..pictures).for_each(|_| grid.add(kind, [place].into_iter(), 1.3));
            let silent = Beam { cone_rad: 0.5, flags: NO_ECHO, ..Beam::default() };
            (0..200).for_each(|_| grid.add_beam(&silent, &Pose2::IDENTITY, |_| true));
            occupied(&grid).len() == 1
        };
        assert!(!is_kept(Evidence::Look, 9), "paint and mirror images end the floor, too");
        assert!(is_kept(Evidence::Upright, 4), "smooth surfaces at an angle give no echo");
        assert!(!is_kept(Evidence::Upright, 3), "a mirror image that moves passes a place in three pictures");
    }

    #[test]
    fn a_thing_of_the_floors_color_stays_where_motion_shows_it() {
        let place = Point2::new(0.52, 0.03);
        let is_kept = |looks_raised: bool, moves_as_floor: bool| {
            let mut grid = OccupancyGrid::default();
            for _ in 0..6 {
                grid.add(Evidence::Motion, [place].into_iter(), 1.0);
                if looks_raised {
                    grid.add_thing([(place + Vector2::new(CELL_M, 0.0), false)].into_iter(), 1.3);
                }
            }
            assert!(!occupied(&grid).is_empty());
            for _ in 0..20 {
                grid.add_floor([(place, true)].into_iter(), -0.7);
                if moves_as_floor {
                    grid.add(Evidence::Motion, [place].into_iter(), -0.7);
                }
            }
            occupied(&grid).iter().any(|found| (found - place).norm() < CELL_M / 2.0)
        };
        assert!(is_kept(false, false), "its color says nothing");
        assert!(!is_kept(true, false), "what looked different has gone when floor is seen");
        assert!(!is_kept(false, true), "what moves as floor is floor");
    }

    #[test]
    fn the_sensors_outvote_each_other_in_time() {
        let place = Point2::new(0.52, 0.03);
        let beyond = Beam { cone_rad: 0.5, range_m: 2.5, ..Beam::default() };
        let mut grid = OccupancyGrid::default();
        for _ in 0..4 {
            grid.add(Evidence::Look, [place].into_iter(), 1.3);
        }
        for _ in 0..8 {
            grid.add_beam(&beyond, &Pose2::IDENTITY, |_| true);
        }
        assert_eq!(occupied(&grid).len(), 1, "an echo of what is beyond may have passed it");
        for _ in 0..8 {
            grid.add_beam(&beyond, &Pose2::IDENTITY, |_| true);
        }
        assert!(occupied(&grid).is_empty(), "but not so many");
        grid.add_beam(&Beam { range_m: 0.5, ..beyond }, &Pose2::IDENTITY, |_| true);
        for _ in 0..4 {
            grid.add(Evidence::Look, [place].into_iter(), 1.3);
        }
        assert!(!occupied(&grid).is_empty());
    }
}
