//! Evidence of things from the motion of the floor plane, with the votes of edge counts and echoes.
//!
//! Independent of thresholds, and of what the floor looks like: joints and shadows that move with the floor are floor.

use nalgebra::Point2;
use yamabico_core::camera::{Distortion, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::Beam;
use yamabico_core::time::Time;
use yamabico_vision::plane_motion::PlaneMotion;
use yamabico_vision::plane_motion::evidence_grid::Echo;

/// Distances ahead of the robot's center at which things count, m: the camera sees no floor nearer.
const AHEAD_M: std::ops::Range<f64> = 0.4..3.0;
/// Radii of things, m.
const RADIUS_M: std::ops::RangeInclusive<f64> = 0.12..=0.3;
/// Smallest log odds of a thing's best cell.
const MIN_PEAK: f64 = 2.0;

/// Evidence around the robot. Positions are in the robot frame at the newest capture, m.
#[derive(Clone, Debug)]
pub(crate) struct MotionEvidence {
    motion: PlaneMotion,
    odometry: Pose2,
    scan: Option<Time>,
}

impl MotionEvidence {
    /// Creates the evidence of a camera; `None` if its lens distorts or it stands on the floor.
    pub fn new(pinhole: &Pinhole, mount: Mount) -> Option<Self> {
        let is_usable = *pinhole.distortion() == Distortion::NONE && mount.z > 0.0;
        is_usable.then(|| Self {
            motion: PlaneMotion::new(*pinhole.intrinsics(), mount),
            odometry: Pose2::IDENTITY,
            scan: None,
        })
    }

    /// Takes in an image captured at `odometry`. Images that cannot be judged leave the evidence as it is.
    pub fn look(&mut self, image: ImageView, odometry: Pose2, capture: Time) {
        self.odometry = odometry;
        let _ = self.motion.look(image, odometry, capture.as_secs_f64());
    }

    /// Takes in the echoes of a scan once, for a robot at `odometry`.
    pub fn add_scan(&mut self, beams: &[Beam], stamp: Option<Time>, odometry: Pose2) {
        if stamp.is_none() || stamp == self.scan {
            return;
        }
        self.scan = stamp;
        for beam in beams {
            let Some(range_m) = beam.echo_m() else { continue };
            let sensor = odometry * Pose2::new(beam.x_m, beam.y_m, beam.azimuth_rad);
            let echo = Echo { sensor, range_m, half_cone: 0.5 * beam.cone_rad };
            self.motion.grid_mut().add_echo(&echo);
        }
    }

    /// Takes in that edges show something at a place. Returns false if plane motion has said that it is floor.
    pub fn accept_edges(&mut self, at: Point2<f64>) -> bool {
        let place = self.odometry.transform_point(at);
        let is_floor = self.motion.grid().is_floor(place);
        self.motion.grid_mut().vote_thing(place);
        !is_floor
    }

    /// Things ahead with their radii, m, from the cells at `counted` places.
    pub fn things(
        &mut self,
        counted: impl Fn(Point2<f64>) -> bool,
    ) -> impl Iterator<Item = (Point2<f64>, f64)> {
        let to_robot = self.odometry.inverse();
        let is_counted = |place: Point2<f64>| {
            let at = to_robot.transform_point(place);
            AHEAD_M.contains(&at.x) && at.y.abs() < at.x && counted(at)
        };
        let things = self.motion.obstacles(&self.odometry, is_counted).iter();
        things.filter(|thing| thing.peak >= MIN_PEAK).map(move |thing| {
            let radius_m = thing.half_width_m.clamp(*RADIUS_M.start(), *RADIUS_M.end());
            (to_robot.transform_point(thing.foot), radius_m)
        })
    }
}
