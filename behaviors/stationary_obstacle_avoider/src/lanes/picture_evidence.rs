//! Evidence of a picture: floor and its ends, upright edges, and motion.

use nalgebra::{Point2, Vector2};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::{Beam, FrameHeader, Reason, View};
use yamabico_core::odometry_track::travel;
use yamabico_core::time::Time;
use yamabico_vision::floor_appearance::Picture;
use yamabico_vision::floor_columns::{FloorEnd, FreeFloor};
use yamabico_vision::map::WireFrame;

use super::motion::FloorMotion;
use super::occupancy::{self, Evidence, neighbors};
use super::refuted_walls::is_refuted;
use super::stations::PathAhead;
use super::upright_edges::UprightEdges;
use super::{ASIDE_RAD, LaneAvoider, WALL_M};

/// Log odds of floor, and of the place where it ends, in one picture.
const FLOOR: f32 = -0.7;
const FLOOR_END: f32 = 1.3;
/// Log odds of an end of the floor before an echo: a mirror image, or something below the beam; and in a beam without an
/// echo, which a smooth surface at an angle does not give.
const FLOOR_END_BEFORE_ECHO: f32 = 0.2;
const FLOOR_END_IN_SILENCE: f32 = 0.7;
/// Distance before an echo from which an end of the floor lies before it, and distance from an echo up to which it lies at it, m.
const BEFORE_ECHO_M: f64 = 0.15;
const AT_ECHO_M: f64 = 0.12;
/// Cells behind the foot of an obstacle wider than a speck that count as its own until floor is seen there.
const HIDDEN_CELLS: u8 = 5;
/// Log odds of the foot of what moves as a thing, of an upright edge, and of an end of the floor at an echo.
const MOVES_AS_THING: f32 = 1.0;
const UPRIGHT_EDGE: f32 = 1.3;
const FLOOR_END_AT_ECHO: f32 = 1.0;
/// Motion between pictures whose upright edges count, m: the foot of a mirror image moves along by most of it, and from one place
/// the same chance edge would count again and again.
const EDGE_MOTION_M: f64 = 0.07;
/// Distances ahead of the robot up to which floor and its end count, m.
const FLOOR_M: f64 = 2.6;
pub(super) const FLOOR_END_M: f64 = 2.4;
/// Distance from the robot up to which a column that looks like floor up to above the horizon shows floor for sure, m: what is farther away
/// may be a wall of the floor's color: it clears things, but no floor was seen there.
const BOUNDLESS_M: f64 = 1.1;
/// Range of an echo below which a picture without floor shows a wall, m.
const WALL_ECHO_M: f64 = 1.2;
/// Share of a beam's opening angle within which it tells of an end of the floor.
const BEAM_SHARE: f64 = 0.7;
/// Time after which a picture without floor, echo or wall shows another light although something is known to stand near, s.
const NO_FLOOR_S: f64 = 4.0;
/// Time over which a robot moves less than that far, m, and turns by less, rad, while it stands, s.
const STANDS_S: f64 = 0.3;
const STANDS: (f64, f64) = (0.01, 0.01);

impl LaneAvoider {
    /// Takes in a picture.
    pub(super) fn look(&mut self, frame: &View<'_, FrameHeader>, now: Time) -> Result<(), Reason> {
        let stamp = Time(frame.header.stamp_ns);
        if !stamp.is_next(self.last_picture, now) {
            return Err(Reason::MalformedInput);
        }
        let robot = self.odometry.pose_at(stamp).ok_or(Reason::NoInput)?;
        let learns = !self.is_occupied_near();
        self.columns.tolerate_spread(self.motion.as_ref().is_some_and(FloorMotion::is_matt));
        let color = frame.rgb(self.size).map(Picture::Color);
        let picture = color.or_else(|| frame.gray(self.size, &mut self.gray).map(Picture::Gray));
        if !self.columns.look(picture.ok_or(Reason::MalformedInput)?, learns) {
            return Err(Reason::MalformedInput);
        }
        // A wall so near gives an echo; without one it is the floor that looks different, as in sunlight. What stands near
        // and is known from before may fill the view, and give no echo at an angle.
        let is_other_light = self.columns.shows_no_floor()
            && !self.sonar.is_silent()
            && self.sonar.nearest_m(-ASIDE_RAD..ASIDE_RAD) > WALL_ECHO_M;
        if !is_other_light {
            self.no_floor_since = None;
        } else if learns || stamp.seconds_after(*self.no_floor_since.get_or_insert(stamp)) > NO_FLOOR_S {
            self.columns.relearn();
        }
        self.last_picture = Some(stamp);
        self.advance(stamp, &robot);
        let path =
            PathAhead::of(&self.guidance, self.map_from_odometry().map(|on_map| on_map * robot).as_ref());
        self.hidden.clear();
        if let Some(image) = frame.gray(self.size, &mut self.gray) {
            if let Some(motion) = &mut self.motion {
                motion.look(image, robot, stamp.as_secs_f64(), self.columns.ends(), &mut self.hidden);
            }
            let is_matt = self.motion.as_ref().is_none_or(FloorMotion::is_matt);
            match &mut self.edges {
                Some(edges) if is_matt => edges.look(image, &mut self.hidden),
                Some(edges) => edges.clear(),
                None => {}
            }
        }
        if self.config.uses_look {
            self.add_look(robot, &path, now);
        }
        self.add_geometry(robot, &path);
        self.grid.update_arrivals(self.shows_what_comes(stamp));
        self.refute_walls();
        Ok(())
    }

    /// Adds the floor that a picture taken at `robot` (odometry frame) shows, and where it ends.
    fn add_look(&mut self, robot: Pose2, path: &PathAhead, now: Time) {
        let (on_map, is_matt) = (self.map_from_odometry(), self.is_matt());
        let is_sure = self.last_picture.is_some_and(|stamp| self.shows_what_comes(stamp));
        let Self { grid, columns, hidden, covered, edges, near_walls, motion, sonar, crossing, .. } = self;
        let ground = Ground { robot, on_map, near_walls, motion: motion.as_ref() };
        let is_thing = |end: &FloorEnd| end.place.x < FLOOR_END_M && ground.is_raised(end.place);
        let is_new = |end: &FloorEnd| {
            let is_sure = is_sure || is_at_echo(end.place, sonar.beams());
            is_sure && !end.is_lone && grid.is_free_floor(ground.odometry(end.place))
        };
        let new = columns.ends().filter(|end| is_thing(end) && is_new(end));
        crossing.glimpse(now.as_secs_f64(), path, new.map(|end| end.place));
        let free = columns.free().filter(|floor| floor.place.x < FLOOR_M && !hidden.is_hidden(floor.place));
        let is_seen = |floor: &FreeFloor| !floor.is_boundless || floor.place.coords.norm() < BOUNDLESS_M;
        grid.add_floor(free.map(|floor| (ground.odometry(floor.place), is_seen(&floor))), FLOOR);
        let beams = sonar.beams();
        for weight in [FLOOR_END, FLOOR_END_IN_SILENCE, FLOOR_END_BEFORE_ECHO] {
            let ends = columns.ends().filter(|end| is_thing(end) && end_weight(end.place, beams) == weight);
            grid.add_thing(ground.deep(ends).map(|(place, is_darker)| (place, is_darker && is_matt)), weight);
        }
        // Light and paint give no echo, and things give none at most angles: two senses that once agreed outlast silence.
        let heard = columns.ends().filter(|end| is_thing(end) && is_at_echo(end.place, beams));
        grid.add(Evidence::Upright, ground.deep(heard).map(|(place, _)| place), FLOOR_END_AT_ECHO);
        // The side of a thing whose foot is below the picture: it stands where the picture begins, or nearer.
        let cut =
            || edges.iter().flat_map(UprightEdges::cut).flat_map(|edge| columns.covered_beside(edge.pixel.x));
        let things = cut().flat_map(|foot| behind(foot, foot.coords, ground.cells_behind(foot)));
        grid.add_thing(things.map(|place| (ground.odometry(place), false)), FLOOR_END);
        covered.look(robot, cut(), |place| {
            grid.shows_floor(ground.odometry(place)) || end_weight(place, beams) == FLOOR_END_BEFORE_ECHO
        });
    }

    /// True if the floor is known not to mirror, or motion is not judged: in a mirror, what stands elsewhere has edges.
    pub(super) fn is_matt(&self) -> bool {
        self.motion.as_ref().is_none_or(FloorMotion::is_matt)
    }

    /// True if what a picture taken at `stamp` shows to come has come, and is no mirror image: these come and go as the robot moves.
    fn shows_what_comes(&self, stamp: Time) -> bool {
        let pose_before =
            |seconds: f64| self.odometry.pose_at(Time::from_secs_f64(stamp.as_secs_f64() - seconds));
        let stands = || {
            let [from, to] = [STANDS_S, 0.0].map(pose_before);
            let (moved_m, turned_rad) = travel(&from?, &to?);
            Some(moved_m < STANDS.0 && turned_rad < STANDS.1)
        };
        self.is_matt() || stands() == Some(true)
    }

    /// Adds upright edges, and what moves as a thing.
    fn add_geometry(&mut self, robot: Pose2, path: &PathAhead) {
        let on_map = self.map_from_odometry();
        let Self { grid, edges, edges_from, near_walls, motion, .. } = self;
        let ground = Ground { robot, on_map, near_walls, motion: motion.as_ref() };
        if let Some(edges) = edges
            && !edges.found().is_empty()
            && edges_from.is_none_or(|from| from.distance(&robot) > EDGE_MOTION_M)
        {
            *edges_from = Some(robot);
            let feet =
                edges.feet(path.heading(), |place| ground.is_raised(place), |foot| ground.cells_behind(foot));
            grid.add(Evidence::Upright, feet.map(|place| ground.odometry(place)), UPRIGHT_EDGE);
        }
        if let Some(motion) = &*motion {
            // In a mirror, motion is as doubtful as looks.
            let kind = if motion.is_matt() { Evidence::Motion } else { Evidence::Look };
            let floor = motion.floor(FLOOR_END_M).flat_map(|place| neighbors(ground.odometry(place)));
            grid.add(Evidence::Motion, floor, FLOOR);
            grid.add(kind, motion.things(FLOOR_END_M).map(|place| ground.odometry(place)), MOVES_AS_THING);
        }
    }

    /// Leaves out walls of the corridor beyond which floor was seen.
    fn refute_walls(&mut self) {
        let (Some(on_map), Some(newest)) = (self.map_from_odometry(), self.odometry.newest()) else { return };
        let (to_odometry, robot) = (on_map.inverse(), on_map * newest.pose);
        let Some(frame) = self.guidance.corridor_mut() else { return };
        let is_floor = |place: Point2<f64>| self.grid.shows_floor(to_odometry.transform_point(place));
        let [left, right] = frame.seen_walls_m();
        let is_none = |wall_m: Option<f64>, outward: f64| {
            wall_m.is_some_and(|wall_m| is_refuted(wall_m, outward, robot.x, is_floor))
        };
        frame.refute([is_none(left, 1.0), is_none(right, -1.0)]);
    }
}

/// Floor around a robot at `robot`, odometry frame, and what is known of it. Places are in the robot frame, m.
struct Ground<'a> {
    robot: Pose2,
    /// Transform from the odometry frame to the map frame.
    on_map: Option<Pose2>,
    near_walls: &'a WireFrame,
    motion: Option<&'a FloorMotion>,
}

impl Ground<'_> {
    fn odometry(&self, place: Point2<f64>) -> Point2<f64> {
        self.robot.transform_point(place)
    }

    /// Places of the things that the floor ends at, odometry frame, m, and whether they are darker than it.
    fn deep(&self, ends: impl Iterator<Item = FloorEnd>) -> impl Iterator<Item = (Point2<f64>, bool)> {
        ends.flat_map(move |FloorEnd { place, is_lone, is_darker, .. }| {
            let deep = behind(place, place.coords, if is_lone { 0 } else { self.cells_behind(place) });
            deep.map(move |place| (self.odometry(place), is_darker))
        })
    }

    /// True unless the place is known to be floor that looks different.
    fn is_raised(&self, place: Point2<f64>) -> bool {
        self.motion.is_none_or(|motion| !motion.is_flat(self.odometry(place)))
    }

    /// Cells behind the foot of an obstacle that count as its own; none of a wall, behind which nothing needs to be known.
    fn cells_behind(&self, foot: Point2<f64>) -> u8 {
        let is_wall = self.on_map.is_some_and(|on_map| {
            self.near_walls.clearance(on_map.transform_point(self.odometry(foot))) < WALL_M
        });
        if is_wall { 0 } else { HIDDEN_CELLS }
    }
}

/// Beams that `place` lies in, and its distance from each sensor, m.
fn beams_to(place: Point2<f64>, beams: &[Beam]) -> impl Iterator<Item = (&Beam, f64)> {
    beams.iter().filter_map(move |beam| {
        let off = place - Point2::new(beam.x_m, beam.y_m);
        let is_inside =
            angle_between(off.y.atan2(off.x), beam.azimuth_rad) < 0.5 * BEAM_SHARE * beam.cone_rad;
        is_inside.then(|| (beam, off.norm()))
    })
}

/// Log odds of an end of the floor at `place` by the beams that it lies in.
fn end_weight(place: Point2<f64>, beams: &[Beam]) -> f32 {
    let passed = beams_to(place, beams)
        .filter(|(beam, range_m)| beam.echo_m().is_none_or(|echo_m| range_m + BEFORE_ECHO_M < echo_m));
    match passed.map(|(beam, _)| beam.echo_m().is_some()).max() {
        None => FLOOR_END,
        Some(false) => FLOOR_END_IN_SILENCE,
        Some(true) => FLOOR_END_BEFORE_ECHO,
    }
}

/// True if a beam has an echo at `place`.
fn is_at_echo(place: Point2<f64>, beams: &[Beam]) -> bool {
    beams_to(place, beams)
        .any(|(beam, range_m)| beam.echo_m().is_some_and(|echo_m| (range_m - echo_m).abs() < AT_ECHO_M))
}

/// Places from the foot of an obstacle on, that many cells in the direction `away` from the robot: it is deeper than its foot, and
/// how deep is not seen.
pub(super) fn behind(foot: Point2<f64>, away: Vector2<f64>, cells: u8) -> impl Iterator<Item = Point2<f64>> {
    let step = away.normalize() * occupancy::CELL_M;
    (0..=cells).map(move |cells| foot + step * f64::from(cells))
}

/// Absolute difference of two angles, rad.
fn angle_between(a: f64, b: f64) -> f64 {
    angle_difference(a, b).abs()
}

#[cfg(test)]
mod tests {
    use yamabico_core::message::NO_ECHO;

    use super::*;

    #[test]
    fn an_end_of_the_floor_is_weighed_by_the_beams_that_it_lies_in() {
        let beam =
            |range_m: f64, flags: u32| Beam { cone_rad: 0.6, range_m, x_m: 0.2, flags, ..Beam::default() };
        let judged = |x: f64, y: f64, beam: Beam| {
            let place = Point2::new(x, y);
            (end_weight(place, &[beam]), is_at_echo(place, &[beam]))
        };
        assert_eq!(judged(1.25, 0.1, beam(1.0, 0)), (FLOOR_END, true));
        assert_eq!(judged(1.0, 0.1, beam(1.0, 0)), (FLOOR_END_BEFORE_ECHO, false));
        assert_eq!(judged(1.4, 0.1, beam(1.0, 0)), (FLOOR_END, false), "behind the echo");
        assert_eq!(judged(1.2, 0.0, beam(2.0, NO_ECHO)), (FLOOR_END_IN_SILENCE, false));
        assert_eq!(judged(1.1, 0.5, beam(1.0, 0)), (FLOOR_END, false), "beside the beam");
    }
}
