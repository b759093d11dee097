//! Drawings around the robot: its outline, sonar cones, proposals, commands and ground truth.

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::scene_entity_deletion::Type as Deletion;
use foxglove::messages::{
    ArrowPrimitive, Color, LinePrimitive, Point3, SceneEntity, SceneEntityDeletion, SceneUpdate,
    TextPrimitive,
};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Beam, Command, Kind, Proposal, RangeScanHeader, Reason, Truth, Twist};
use yamabico_core::range_scan::sectors;

use super::frames::{BASE, MAP, pose, timestamp};

/// Time for which a proposed motion is drawn ahead, s.
const PREVIEW_S: f64 = 2.0;
/// Number of corners of a drawn circle or arc.
const CORNERS: usize = 24;
/// Minimum speed that is drawn as an arrow, m/s.
const MIN_ARROW_MPS: f64 = 0.01;

const BLACK: Color = Color { r: 0.1, g: 0.1, b: 0.1, a: 1.0 };
const GRAY: Color = Color { r: 0.6, g: 0.6, b: 0.6, a: 0.5 };
const RED: Color = Color { r: 0.85, g: 0.15, b: 0.15, a: 1.0 };
const ORANGE: Color = Color { r: 0.95, g: 0.55, b: 0.1, a: 1.0 };
const GREEN: Color = Color { r: 0.1, g: 0.6, b: 0.3, a: 1.0 };
const BLUE: Color = Color { r: 0.15, g: 0.35, b: 0.8, a: 1.0 };

/// Outline of the robot: the circle around its footprint, with a mark at the front.
pub(super) fn footprint(stamp_ns: u64, radius_m: f64) -> SceneUpdate {
    let mut entity = entity(stamp_ns, BASE, "footprint");
    entity.lines = vec![
        line(circle(radius_m), LineType::LineLoop, 0.02, BLACK),
        line(vec![point(0.0, 0.0), point(radius_m, 0.0)], LineType::LineStrip, 0.02, BLACK),
    ];
    shown(entity)
}

/// Free part of each sonar cone, or of sectors of a laser scan: red up to an echo, gray up to the maximum range without one.
pub(super) fn cones(topic: &str, header: &RangeScanHeader, beams: &[Beam]) -> SceneUpdate {
    let mut entity = entity(header.stamp_ns, BASE, topic);
    let mut few = Vec::new();
    sectors(beams, &mut few);
    entity.lines = few.iter().filter_map(|beam| cone(header, beam)).collect();
    shown(entity)
}

fn cone(header: &RangeScanHeader, beam: &Beam) -> Option<LinePrimitive> {
    let (range_m, color) = match beam.echo_m() {
        Some(range_m) => (range_m, RED),
        None => (header.max_m, GRAY),
    };
    let numbers = [range_m, beam.azimuth_rad, beam.cone_rad, beam.x_m, beam.y_m];
    if numbers.iter().any(|number| !number.is_finite()) {
        return None;
    }
    let arc = (0..=CORNERS / 2).map(|i| {
        let share = i as f64 / (CORNERS / 2) as f64 - 0.5;
        let (sin, cos) = (beam.azimuth_rad + share * beam.cone_rad).sin_cos();
        point(beam.x_m + range_m * cos, beam.y_m + range_m * sin)
    });
    let corners = std::iter::once(point(beam.x_m, beam.y_m)).chain(arc).collect();
    Some(line(corners, LineType::LineLoop, 0.01, color))
}

/// Draws a drive as the path it leads to, a halt or a limit as text; an abstention removes the author's drawing.
pub(super) fn proposal(topic: &str, proposal: &Proposal) -> SceneUpdate {
    let mut entity = entity(proposal.stamp_ns, BASE, topic);
    let author = proposal.behavior.as_str();
    let reason = proposal.reason().map_or("unknown reason", Reason::as_str);
    match proposal.kind() {
        Some(Kind::Drive) if proposal.twist.is_finite() => motion(&mut entity, &proposal.twist, BLUE, 0.02),
        Some(Kind::Limit) => entity.texts.push(label(format!("{author} limits: {reason}"), ORANGE)),
        Some(Kind::Halt) => entity.texts.push(label(format!("{author} halts: {reason}"), RED)),
        _ => return removed(proposal.stamp_ns, topic),
    }
    shown(entity)
}

/// Draws a command as the path it leads to.
pub(super) fn command(topic: &str, command: &Command) -> SceneUpdate {
    let mut entity = entity(command.stamp_ns, BASE, topic);
    let color = if command.emergency == 0 { GREEN } else { RED };
    if command.twist.is_finite() {
        motion(&mut entity, &command.twist, color, 0.04);
    }
    shown(entity)
}

/// Draws the true position of the robot, and the distance of the nearest person.
pub(super) fn truth(topic: &str, truth: &Truth, radius_m: f64) -> Option<SceneUpdate> {
    let at = Pose2::new(truth.x, truth.y, truth.theta);
    if !at.is_finite() {
        return None;
    }
    let mut entity = entity(truth.stamp_ns, MAP, topic);
    let mut outline = line(circle(radius_m), LineType::LineLoop, 0.02, GREEN);
    outline.pose = Some(pose(&at));
    entity.lines.push(outline);
    if truth.person_m.is_finite() {
        let mut text = label(format!("person {:.2} m", truth.person_m), GREEN);
        text.pose = Some(pose(&at));
        entity.texts.push(text);
    }
    Some(shown(entity))
}

fn motion(entity: &mut SceneEntity, twist: &Twist, color: Color, thickness: f64) {
    let at = |share: f64| Pose2::IDENTITY.integrate(twist, share * PREVIEW_S);
    let path = (0..=CORNERS).map(|i| {
        let pose = at(i as f64 / CORNERS as f64);
        point(pose.x, pose.y)
    });
    entity.lines.push(line(path.collect(), LineType::LineStrip, thickness, color));
    if twist.speed() >= MIN_ARROW_MPS {
        let mut tip = at(1.0);
        tip.theta += twist.lateral.atan2(twist.linear);
        entity.arrows.push(ArrowPrimitive {
            pose: Some(pose(&tip)),
            shaft_length: 0.0,
            shaft_diameter: 0.0,
            head_length: 4.0 * thickness,
            head_diameter: 3.0 * thickness,
            color: Some(color),
        });
    }
}

/// Corners of a circle about the origin.
pub(super) fn circle(radius_m: f64) -> Vec<Point3> {
    let corner = |i: usize| (i as f64 / CORNERS as f64 * std::f64::consts::TAU).sin_cos();
    (0..CORNERS).map(corner).map(|(sin, cos)| point(radius_m * cos, radius_m * sin)).collect()
}

/// Point on the floor.
pub(super) fn point(x: f64, y: f64) -> Point3 {
    Point3 { x, y, z: 0.0 }
}

/// Line in the frame of its entity.
pub(super) fn line(points: Vec<Point3>, kind: LineType, thickness: f64, color: Color) -> LinePrimitive {
    LinePrimitive {
        r#type: kind as i32,
        pose: Some(pose(&Pose2::IDENTITY)),
        thickness,
        points,
        color: Some(color),
        ..LinePrimitive::default()
    }
}

fn label(text: String, color: Color) -> TextPrimitive {
    let above = Pose2::new(0.0, 0.4, 0.0);
    TextPrimitive {
        pose: Some(pose(&above)),
        billboard: true,
        font_size: 0.12,
        scale_invariant: false,
        color: Some(color),
        text,
    }
}

/// Empty entity that moves with its frame.
pub(super) fn entity(stamp_ns: u64, frame_id: &str, id: &str) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: frame_id.to_owned(),
        id: id.to_owned(),
        frame_locked: true,
        ..SceneEntity::default()
    }
}

/// Scene with this entity, which replaces the one of the same name on its topic.
pub(super) fn shown(entity: SceneEntity) -> SceneUpdate {
    SceneUpdate { deletions: Vec::new(), entities: vec![entity] }
}

fn removed(stamp_ns: u64, id: &str) -> SceneUpdate {
    let deletion = SceneEntityDeletion {
        timestamp: Some(timestamp(stamp_ns)),
        r#type: Deletion::MatchingId as i32,
        id: id.to_owned(),
    };
    SceneUpdate { deletions: vec![deletion], entities: Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Axes, NO_ECHO};

    #[test]
    fn a_cone_ends_at_its_echo_or_at_the_maximum_range() {
        let header = RangeScanHeader { max_m: 3.0, ..Default::default() };
        let echo = Beam { range_m: 0.4, cone_rad: 0.4, x_m: 0.2, ..Beam::default() };
        let silent = Beam { flags: NO_ECHO, ..echo };
        let hostile = Beam { range_m: f64::NAN, ..echo };
        let lines = &cones("sonar", &header, &[echo, silent, hostile]).entities[0].lines;
        assert_eq!(lines.len(), 2);
        let farthest = |line: &LinePrimitive| line.points.iter().map(|point| point.x).fold(0.0, f64::max);
        assert!((farthest(&lines[0]) - 0.6).abs() < 1e-12 && (farthest(&lines[1]) - 3.2).abs() < 1e-12);
    }

    #[test]
    fn a_left_turn_is_drawn_to_the_left_and_an_abstention_removes_the_drawing() {
        let drive = Proposal::drive(Axes::PLANAR, Twist::planar(0.4, 0.5));
        let scene = proposal("wall-follower", &drive);
        assert!(scene.entities[0].lines[0].points.last().unwrap().y > 0.1);
        let scene = proposal("wall-follower", &Proposal::abstain(Reason::NoWall));
        assert_eq!((scene.entities.len(), scene.deletions[0].id.as_str()), (0, "wall-follower"));
        let hostile = Proposal::drive(Axes::PLANAR, Twist::planar(f64::NAN, 0.0));
        assert!(proposal("wall-follower", &hostile).entities.is_empty());
    }
}
