//! A robot with a mirror camera on the small field.

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Calibration, MirrorCamera, Mount};
use yamabico_core::message::{Axes, Encoding, FrameHeader, Message, Odometry};
use yamabico_core::sensor::{MotionLimits, Robot, SensorInfo, SensorKind};
use yamabico_core::time::Time;

use crate::field::{LENS_M, RADIUS_M};

/// What the behavior is told besides its defaults.
pub const CONFIG: &str = "method = 'polar-cells'\nspeed_mps = 0.4\nmargin_m = 0.03\nturn_radps = 2.0\n";

/// A robot with this camera whose drive has these axes.
pub fn setup(camera: MirrorCamera, axes: Axes) -> Setup {
    let sensor = |name: &str, message, period_s, latency_s, kind| SensorInfo {
        name: name.into(),
        message,
        period_s,
        latency_s,
        kind,
    };
    let (mount, calibrated) = (Mount::level(LENS_M), Calibration::Measured);
    let kind = SensorKind::MirrorCamera { camera: Box::new(camera), mount, calibrated };
    let limits = MotionLimits {
        speed: [0.6, 0.6, 3.0],
        acceleration: [0.3, 0.3, 8.0],
        deceleration: [0.3, 0.3, 8.0],
        jerk: [20.0, 20.0, 200.0],
        ..MotionLimits::default()
    };
    Setup {
        robot: Robot { radius_m: RADIUS_M, axes, limits, ..Robot::default() },
        sensors: vec![
            ("camera".into(), sensor("around", FrameHeader::NAME, 0.04, 0.02, kind)),
            ("odometry".into(), sensor("wheels", Odometry::NAME, 0.02, 0.0, SensorKind::Other)),
        ],
        ..Setup::default()
    }
}

/// The header of a color picture.
pub fn frame_header(seconds: f64) -> FrameHeader {
    FrameHeader {
        stamp_ns: Time::from_secs_f64(seconds).0,
        width: 256,
        height: 220,
        stride: 3 * 256,
        encoding: Encoding::Rgb8.code(),
        ..FrameHeader::default()
    }
}
