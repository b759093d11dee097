//! Places along the path, from which the lanes are measured.

use nalgebra::{Point2, Vector2};
use yamabico_core::geometry::Pose2;

use crate::guidance::Guidance;
use crate::passage_finder::point_on_path;

/// Distance of two stations along the path, m.
pub const STATION_M: f64 = 0.08;
/// Number of stations: lanes are rated over 2.3 m.
pub const STATIONS: usize = 29;

/// A place on the path, robot frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Position, m.
    pub place: Point2<f64>,
    /// Unit vector to the left of the path.
    pub left: Vector2<f64>,
}

impl Station {
    /// Returns the position `offset_m` (m) to the left of the path.
    #[must_use]
    pub fn beside(&self, offset_m: f64) -> Point2<f64> {
        self.place + self.left * offset_m
    }
}

/// Returns the distance of a station ahead of the robot, m.
#[must_use]
pub fn station_m(index: usize) -> f64 {
    0.05 + index as f64 * STATION_M
}

/// The path ahead of a robot.
#[derive(Clone, Debug)]
pub struct PathAhead {
    /// Stations, the nearest first.
    pub stations: [Station; STATIONS],
    /// Distance of the robot from the path, m, positive left.
    pub lateral_m: f64,
}

impl Default for PathAhead {
    /// Straight ahead.
    fn default() -> Self {
        let station = |i| Station { place: Point2::new(station_m(i), 0.0), left: Vector2::y() };
        Self { stations: std::array::from_fn(station), lateral_m: 0.0 }
    }
}

impl PathAhead {
    /// Returns the path ahead of a robot at `robot` (frame of the path); straight ahead if the pose or the path is unknown.
    pub(crate) fn of(guidance: &Guidance, robot: Option<&Pose2>) -> Self {
        let mut ahead = Self::default();
        let (path, progress_m) = (guidance.path(), guidance.path_header().progress_m);
        let Some(robot) = robot.filter(|_| path.len() > 1) else { return ahead };
        let Some((place, heading)) = point_on_path(path, progress_m, 0.0) else { return ahead };
        let off = robot.position() - place;
        let along_m = off.x * heading.cos() + off.y * heading.sin();
        ahead.lateral_m = off.y * heading.cos() - off.x * heading.sin();
        let to_robot = robot.inverse();
        for (i, station) in ahead.stations.iter_mut().enumerate() {
            if let Some((place, heading)) = point_on_path(path, progress_m + along_m, station_m(i)) {
                let left = Vector2::new(-heading.sin(), heading.cos());
                *station =
                    Station { place: to_robot.transform_point(place), left: to_robot.rotate_vector(left) };
            }
        }
        ahead
    }

    /// True if a place (robot frame) is within `near_m` of some place on the path that is less than `ahead_m` ahead.
    #[must_use]
    pub fn is_near(&self, place: Point2<f64>, ahead_m: f64, near_m: f64) -> bool {
        let ahead = self.stations.iter().enumerate().take_while(|&(i, _)| station_m(i) < ahead_m);
        ahead.map(|(_, station)| (place - station.place).norm()).any(|distance_m| distance_m < near_m)
    }

    /// Distance of a place (robot frame) to the left of the path, m.
    #[must_use]
    pub fn lateral_m_of(&self, place: Point2<f64>) -> f64 {
        let away = |station: &&Station| (place - station.place).norm_squared();
        let nearest = self.stations.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
        nearest.map_or(0.0, |station| station.left.dot(&(place - station.place)))
    }

    /// Direction of the path at the robot, robot frame, rad.
    #[must_use]
    pub fn heading(&self) -> f64 {
        let left = self.stations[0].left;
        -left.x.atan2(left.y)
    }
}
