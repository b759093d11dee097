//! Overlay: the beams with the gate that they are held against.

use nalgebra::Vector2;
use yamabico_core::geometry::{Hypotenuse, Pose2};
use yamabico_core::message::{Beam, RangeScanHeader, Twist, View};
use yamabico_core::overlay::{GRAY, ORANGE, Overlay, RED, YELLOW};

use crate::range_gate::RangeGate;
use crate::swept_gate::SweptGate;

/// Maximum number of lines of an arc, and the angle from which on a line is drawn for each, rad.
const ARC_LINES: u32 = 8;
const ARC_LINE_RAD: f64 = 0.05;
/// Number of poses along the swept path.
const PATH_POSES: u32 = 12;

/// Gate that a scan was held against.
#[derive(Clone, Copy, Debug)]
pub enum Gate<'a> {
    /// Path that the footprint sweeps with each of these twists until it stands.
    Swept(&'a SweptGate, &'a [Twist]),
    /// Fixed range.
    Range(&'a RangeGate),
}

/// Draws the beams, the gate, and the echoes; those in the gate count as `is_blocked` says.
pub fn draw(overlay: &mut Overlay, scan: &View<'_, RangeScanHeader>, gate: Gate<'_>, is_blocked: bool) {
    let mut beams = overlay.robot("beams", GRAY);
    // The rays of a laser scanner would hide what they show.
    for beam in scan.items.iter().filter(|beam| beam.cone_rad > ARC_LINE_RAD) {
        let range_m = beam.echo_m().unwrap_or(scan.header.max_m);
        let foot = Vector2::new(beam.x_m, beam.y_m);
        for side in [-0.5, 0.5] {
            beams.line(foot, on_beam(beam, range_m, side));
        }
    }
    let mut lines = overlay.robot("gate", ORANGE);
    match gate {
        Gate::Swept(gate, twists) => {
            for twist in twists {
                let length_m = gate.stopping.from_speed_m(twist.linear.hypotenuse(twist.lateral));
                for side in [1.0, -1.0] {
                    lines.path(edge(twist, length_m, side * gate.radius_m));
                }
                let end = edge(twist, length_m, 0.0).last();
                lines.circle(end.unwrap_or_default(), gate.radius_m);
            }
        }
        Gate::Range(gate) => {
            for beam in scan.items {
                lines.path(arc(beam, gate.gate_m));
            }
        }
    }
    let mut nearest: Option<(f64, Vector2<f64>)> = None;
    let mut echoes = overlay.robot("echoes", if is_blocked { RED } else { YELLOW });
    for beam in scan.items {
        let Some(range_m) = beam.echo_m().filter(|range_m| range_m.is_finite()) else { continue };
        echoes.path(arc(beam, range_m));
        if nearest.is_none_or(|(nearest_m, _)| range_m < nearest_m) {
            nearest = Some((range_m, on_beam(beam, range_m, 0.0)));
        }
    }
    if let Some((range_m, at)) = nearest {
        echoes.text(at, format_args!("{range_m:.2} m"));
    }
}

/// Point of a beam at `range_m`; `side` from -0.5 (right edge of the cone) to 0.5 (left edge).
fn on_beam(beam: &Beam, range_m: f64, side: f64) -> Vector2<f64> {
    let (sin, cos) = (beam.azimuth_rad + side * beam.cone_rad).sin_cos();
    Vector2::new(beam.x_m + range_m * cos, beam.y_m + range_m * sin)
}

fn arc(beam: &Beam, range_m: f64) -> impl Iterator<Item = Vector2<f64>> {
    let lines = (beam.cone_rad / ARC_LINE_RAD).ceil().clamp(1.0, f64::from(ARC_LINES));
    (0..=lines as u32).map(move |i| on_beam(beam, range_m, f64::from(i) / lines - 0.5))
}

/// Edge of the path of `length_m` with this twist, at `offset_m` to the left of its center.
fn edge(twist: &Twist, length_m: f64, offset_m: f64) -> impl Iterator<Item = Vector2<f64>> {
    let speed_mps = twist.linear.hypotenuse(twist.lateral);
    let time_s = if speed_mps > 0.0 { length_m / speed_mps } else { 0.0 };
    let heading = twist.lateral.atan2(twist.linear);
    (0..=PATH_POSES).map(move |i| {
        let pose = Pose2::IDENTITY.integrate(twist, time_s * f64::from(i) / f64::from(PATH_POSES));
        let (sin, cos) = (pose.theta + heading).sin_cos();
        Vector2::new(pose.x - offset_m * sin, pose.y + offset_m * cos)
    })
}
