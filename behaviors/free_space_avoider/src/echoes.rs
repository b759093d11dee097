//! Echoes of sonars or of a laser scanner: they bound the floor that an image shows as free.

use nalgebra::Vector2;
use yamabico_core::behavior::{Inputs, Setup};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_core::message::Beam;
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::range_scan::MAX_BEAMS;
use yamabico_core::time::Time;

use crate::{SONAR, STALE_S};

/// Maximum angle between two points of an echo's arc, rad.
const ARC_STEP_RAD: f64 = 0.05;
/// Maximum number of points of all arcs.
const MAX_POINTS: usize = 2 * MAX_BEAMS;

/// Newest range scan, and the places of its echoes at the capture of a frame.
#[derive(Clone, Debug, Default)]
pub struct Echoes {
    is_connected: bool,
    newest: Option<Time>,
    beams: Vec<Beam>,
    /// Points of the arcs, robot frame at the capture of the frame, m.
    points: Vec<Vector2<f64>>,
}

impl Echoes {
    /// Returns no echoes; if a scanner is connected, it must not be silent.
    #[must_use]
    pub fn new(setup: &Setup) -> Self {
        Self {
            is_connected: setup.sensor(&SONAR).is_some(),
            newest: None,
            beams: Vec::with_capacity(MAX_BEAMS),
            points: Vec::with_capacity(MAX_POINTS),
        }
    }

    /// Reads the new scans. Malformed ones are left out.
    pub fn update(&mut self, inputs: &Inputs<'_>) {
        for scan in inputs.fresh(&SONAR) {
            let stamp = Time(scan.header.stamp_ns);
            let is_sound = |beam: &Beam| {
                beam.echo_m().is_none_or(|range_m| range_m.is_finite() && range_m >= 0.0)
                    && [beam.azimuth_rad, beam.cone_rad, beam.x_m, beam.y_m].iter().all(|x| x.is_finite())
            };
            let is_scan = (1..=MAX_BEAMS).contains(&scan.items.len()) && scan.items.iter().all(is_sound);
            if is_scan && stamp.is_next(self.newest, inputs.now()) {
                self.newest = Some(stamp);
                self.beams.clear();
                self.beams.extend_from_slice(scan.items);
            }
        }
    }

    /// Returns true if a connected scanner gave no valid scan for longer than half a second.
    #[must_use]
    pub fn is_silent(&self, now: Time) -> bool {
        match self.newest {
            Some(newest) => now.seconds_after(newest) > STALE_S,
            None => self.is_connected,
        }
    }

    /// Places the echoes in the robot frame at `frame`; without odometry as if the robot had not moved since the scan.
    pub fn place(&mut self, odometry: &OdometryTrack, frame: Time) {
        self.points.clear();
        let poses = self.newest.and_then(|scan| odometry.pose_at(frame).zip(odometry.pose_at(scan)));
        let motion = poses.map_or(Pose2::IDENTITY, |(frame, scan)| frame.relative(&scan));
        for beam in &self.beams {
            let Some(range_m) = beam.echo_m() else { continue };
            let steps = (beam.cone_rad.abs() / ARC_STEP_RAD).min(MAX_POINTS as f64) as usize;
            let free = MAX_POINTS - self.points.len();
            self.points.extend((0..=steps).take(free).map(|i| {
                let share = if steps == 0 { 0.0 } else { i as f64 / steps as f64 - 0.5 };
                let (sin, cos) = (beam.azimuth_rad + share * beam.cone_rad).sin_cos();
                let at = nalgebra::Point2::new(beam.x_m + range_m * cos, beam.y_m + range_m * sin);
                motion.transform_point(at).coords
            }));
        }
    }

    /// Returns the distance (m) from `viewpoint` (robot frame) to the nearest echo between two azimuths (rad, right and left);
    /// infinite without one.
    #[must_use]
    pub fn nearest_m(&self, viewpoint: Vector2<f64>, (right_rad, left_rad): (f64, f64)) -> f64 {
        let (middle, half) = (0.5 * (right_rad + left_rad), 0.5 * (left_rad - right_rad).abs());
        let from_view = self.points.iter().map(|point| point - viewpoint);
        let inside = from_view.filter(|ray| angle_difference(ray.y.atan2(ray.x), middle).abs() <= half);
        inside.map(|ray| ray.norm()).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{NO_ECHO, Odometry};

    #[test]
    fn echoes_move_with_the_robot_and_count_in_their_direction() {
        let ahead = Beam { range_m: 2.0, x_m: 0.1, ..Beam::default() };
        let silent = Beam { flags: NO_ECHO, range_m: 0.3, azimuth_rad: 0.2, ..ahead };
        let cone = Beam { azimuth_rad: 1.0, cone_rad: 0.4, range_m: 0.9, ..Beam::default() };
        let mut echoes = Echoes::new(&Setup::default());
        assert!(!echoes.is_silent(Time::from_secs_f64(9.0)), "nothing is connected");
        echoes.newest = Some(Time::from_secs_f64(1.0));
        echoes.beams.extend([ahead, silent, cone]);
        let mut odometry = OdometryTrack::default();
        echoes.place(&odometry, Time::from_secs_f64(1.5));
        let nearest_m =
            |echoes: &Echoes, middle: f64| echoes.nearest_m(Vector2::zeros(), (middle - 0.05, middle + 0.05));
        assert!((nearest_m(&echoes, 0.0) - 2.1).abs() < 1e-12);
        assert_eq!(nearest_m(&echoes, 0.2), f64::INFINITY);
        assert!([0.85, 1.0, 1.15].iter().all(|middle| (nearest_m(&echoes, *middle) - 0.9).abs() < 1e-12));
        for (seconds, x) in [(1.0, 5.0), (1.5, 5.3)] {
            let stamp = Time::from_secs_f64(seconds);
            odometry.push(&Odometry { stamp_ns: stamp.0, x, ..Odometry::default() }, stamp);
        }
        echoes.place(&odometry, Time::from_secs_f64(1.5));
        assert!((nearest_m(&echoes, 0.0) - 1.8).abs() < 1e-9);
    }
}
