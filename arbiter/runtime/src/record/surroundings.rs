//! Drawings of what is around the robot: the map, simulated walls, the goal, obstacles and free space.

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::{Color, CylinderPrimitive, Point3, SceneUpdate, Vector3};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{FreeDirection, Goal, Obstacle, WallPoint, WallsHeader};

use super::frames::{BASE, MAP, pose};
use super::scene::{circle, entity, line, point, shown};

/// Thickness of a wall, m.
const WALL_M: f64 = 0.03;
/// Height of a drawn obstacle, m.
const OBSTACLE_M: f64 = 0.3;

const WALL: Color = Color { r: 0.25, g: 0.25, b: 0.3, a: 1.0 };
const GOAL: Color = Color { r: 0.1, g: 0.6, b: 0.3, a: 1.0 };
const OBSTACLE: Color = Color { r: 0.85, g: 0.35, b: 0.1, a: 1.0 };
const FREE: Color = Color { r: 0.2, g: 0.6, b: 0.9, a: 0.8 };

/// Draws the lines of the map; `None` without lines.
pub(super) fn map(stamp_ns: u64, lines: &[[[f64; 2]; 2]]) -> Option<SceneUpdate> {
    let ends: Vec<Point3> = lines.iter().flatten().map(|[x, y]| point(*x, *y)).collect();
    let mut entity = entity(stamp_ns, MAP, "map");
    entity.lines = vec![line(ends, LineType::LineList, WALL_M, WALL)];
    (!lines.is_empty()).then(|| shown(entity))
}

/// Draws the walls of a simulated device.
pub(super) fn walls(header: &WallsHeader, corners: &[WallPoint]) -> SceneUpdate {
    let mut entity = entity(header.stamp_ns, MAP, header.device.as_str());
    let walls = corners.chunk_by(|a, b| a.line == b.line);
    let known = |corner: &&WallPoint| corner.x.is_finite() && corner.y.is_finite();
    let walls = walls.map(|wall| wall.iter().filter(known).map(|corner| point(corner.x, corner.y)).collect());
    entity.lines = walls.map(|wall| line(wall, LineType::LineStrip, WALL_M, WALL)).collect();
    shown(entity)
}

/// Draws the goal as a circle with the radius of its tolerance; `None` if it is not finite.
pub(super) fn goal(goal: &Goal) -> Option<SceneUpdate> {
    let at = Pose2::new(goal.x, goal.y, 0.0);
    let mut entity = entity(goal.stamp_ns, MAP, "goal");
    let mut outline = line(circle(goal.tolerance_m), LineType::LineLoop, WALL_M, GOAL);
    outline.pose = Some(pose(&at));
    entity.lines.push(outline);
    (at.is_finite() && goal.tolerance_m.is_finite()).then(|| shown(entity))
}

/// Draws obstacles as cylinders: the more probable, the more opaque.
pub(super) fn obstacles(topic: &str, stamp_ns: u64, obstacles: &[Obstacle]) -> SceneUpdate {
    let known = |o: &&Obstacle| [o.x, o.y, o.radius_m, o.confidence].iter().all(|number| number.is_finite());
    let cylinder = |o: &Obstacle| {
        let mut at = pose(&Pose2::new(o.x, o.y, 0.0));
        if let Some(position) = &mut at.position {
            position.z = OBSTACLE_M / 2.0;
        }
        CylinderPrimitive {
            pose: Some(at),
            size: Some(Vector3 { x: 2.0 * o.radius_m, y: 2.0 * o.radius_m, z: OBSTACLE_M }),
            bottom_scale: 1.0,
            top_scale: 1.0,
            color: Some(Color { a: o.confidence.clamp(0.2, 1.0), ..OBSTACLE }),
        }
    };
    let mut entity = entity(stamp_ns, BASE, topic);
    entity.cylinders = obstacles.iter().filter(known).map(cylinder).collect();
    shown(entity)
}

/// Draws the end of the free floor as a line from right to left.
pub(super) fn free_space(topic: &str, stamp_ns: u64, directions: &[FreeDirection]) -> SceneUpdate {
    let ends = directions.iter().map(|direction| {
        let (sin, cos) = direction.azimuth_rad.sin_cos();
        point(direction.distance_m * cos, direction.distance_m * sin)
    });
    let ends = ends.filter(|end| end.x.is_finite() && end.y.is_finite()).collect();
    let mut entity = entity(stamp_ns, BASE, topic);
    entity.lines = vec![line(ends, LineType::LineStrip, WALL_M, FREE)];
    shown(entity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::Name;

    #[test]
    fn obstacles_that_are_not_finite_are_left_out() {
        let obstacle = Obstacle { x: 1.5, radius_m: 0.2, confidence: 0.7, ..Obstacle::default() };
        let hostile = Obstacle { radius_m: f64::NAN, ..obstacle };
        let scene = obstacles("o", 1, &[obstacle, hostile]);
        let cylinders = &scene.entities[0].cylinders;
        assert_eq!((cylinders.len(), cylinders[0].size.unwrap().x), (1, 0.4));
        assert_eq!(cylinders[0].pose.unwrap().position.unwrap().x, 1.5);
    }

    #[test]
    fn a_wall_is_one_line_and_a_map_without_lines_is_no_scene() {
        let corner = |x: f64, line: u64| WallPoint { x, y: 0.0, line };
        let header = WallsHeader { device: Name::new("sim"), ..WallsHeader::default() };
        let scene = walls(&header, &[corner(0.0, 0), corner(1.0, 0), corner(2.0, 1), corner(f64::NAN, 1)]);
        let counts: Vec<_> = scene.entities[0].lines.iter().map(|line| line.points.len()).collect();
        assert_eq!((counts, scene.entities[0].id.as_str()), (vec![2, 1], "sim"));
        assert!(map(0, &[]).is_none());
        assert_eq!(map(0, &[[[0.0, 1.0], [2.0, 1.0]]]).unwrap().entities[0].lines[0].points.len(), 2);
        assert!(goal(&Goal { x: f64::NAN, ..Goal::default() }).is_none());
    }
}
