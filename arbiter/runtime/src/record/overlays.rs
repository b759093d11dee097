//! Conversion of overlays to image annotations and scenes.

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::points_annotation::Type as PointsType;
use foxglove::messages::scene_entity_deletion::Type as Deletion;
use foxglove::messages::{
    CircleAnnotation, Color, ImageAnnotations, LinePrimitive, Point2, Point3, PointsAnnotation, SceneEntity,
    SceneEntityDeletion, SceneUpdate, TextAnnotation, TextPrimitive,
};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{MarkKind, OverlayHeader, OverlayMark};
use yamabico_core::overlay::{LayerView, Space, layers};

use super::frames::{BASE, pose, timestamp};

/// Thickness of a line, px.
const LINE_PX: f64 = 2.0;
/// Size of a letter, px.
const LETTER_PX: f64 = 12.0;
/// Thickness of a line, m.
const LINE_M: f64 = 0.01;
/// Size of a letter, m.
const LETTER_M: f64 = 0.1;
/// Radius of the circle that stands for a point, m.
const POINT_M: f64 = 0.03;
/// Number of corners of a circle in a scene.
const CORNERS: usize = 24;

/// Converts the layers in pixels; `None` if there are none.
pub(super) fn annotations(header: &OverlayHeader, marks: &[OverlayMark]) -> Option<ImageAnnotations> {
    let stamp = Some(timestamp(header.stamp_ns));
    let mut all = ImageAnnotations::default();
    let mut has_layers = false;
    for layer in layers(marks).filter(|layer| layer.space == Space::Image) {
        has_layers = true;
        let color = Some(color(&layer));
        let points = |kind: PointsType, points: Vec<Point2>| PointsAnnotation {
            timestamp: stamp,
            r#type: kind as i32,
            points,
            outline_color: color,
            thickness: LINE_PX,
            ..PointsAnnotation::default()
        };
        let of = |kind: MarkKind| layer.marks.iter().filter(move |mark| mark.kind() == Some(kind));
        let lines: Vec<Point2> = of(MarkKind::Line).flat_map(|mark| [at(mark), to(mark)]).collect();
        let dots: Vec<Point2> = of(MarkKind::Point).map(at).collect();
        all.points.extend((!lines.is_empty()).then(|| points(PointsType::LineList, lines)));
        all.points.extend((!dots.is_empty()).then(|| points(PointsType::Points, dots)));
        all.circles.extend(of(MarkKind::Circle).map(|mark| CircleAnnotation {
            timestamp: stamp,
            position: Some(at(mark)),
            diameter: 2.0 * mark.x2,
            thickness: LINE_PX,
            outline_color: color,
            ..CircleAnnotation::default()
        }));
        all.texts.extend(of(MarkKind::Text).map(|mark| TextAnnotation {
            timestamp: stamp,
            // The schema wants the lower left corner.
            position: Some(Point2 { x: mark.x, y: mark.y + LETTER_PX }),
            text: mark.text.as_str().to_owned(),
            font_size: LETTER_PX,
            text_color: color,
            ..TextAnnotation::default()
        }));
    }
    has_layers.then_some(all)
}

/// Converts the layers in the robot frame, which replace those of the overlay before; `None` if there are none.
pub(super) fn scene(topic: &str, header: &OverlayHeader, marks: &[OverlayMark]) -> Option<SceneUpdate> {
    let entities = layers(marks).filter(|layer| layer.space == Space::Robot);
    let entities: Vec<_> = entities.map(|layer| entity(topic, header.stamp_ns, &layer)).collect();
    let deletion = SceneEntityDeletion {
        timestamp: Some(timestamp(header.stamp_ns)),
        r#type: Deletion::All as i32,
        id: String::new(),
    };
    (!entities.is_empty()).then(|| SceneUpdate { deletions: vec![deletion], entities })
}

fn entity(topic: &str, stamp_ns: u64, layer: &LayerView<'_>) -> SceneEntity {
    let color = color(layer);
    let line = |kind: LineType, points: Vec<Point3>| LinePrimitive {
        r#type: kind as i32,
        pose: Some(pose(&Pose2::IDENTITY)),
        thickness: LINE_M,
        points,
        color: Some(color),
        ..LinePrimitive::default()
    };
    let point = |x: f64, y: f64| Point3 { x, y, z: 0.0 };
    let circle = |mark: &OverlayMark, radius_m: f64| {
        let corner = |i: usize| (i as f64 / CORNERS as f64 * std::f64::consts::TAU).sin_cos();
        let corners = (0..CORNERS).map(corner);
        let corners = corners.map(|(sin, cos)| point(mark.x + radius_m * cos, mark.y + radius_m * sin));
        line(LineType::LineLoop, corners.collect())
    };
    let mut entity = SceneEntity {
        timestamp: Some(timestamp(stamp_ns)),
        frame_id: BASE.to_owned(),
        id: format!("{topic}/{}", layer.name),
        frame_locked: true,
        ..SceneEntity::default()
    };
    let mut ends = Vec::new();
    for mark in layer.marks {
        match mark.kind() {
            Some(MarkKind::Line) => ends.extend([point(mark.x, mark.y), point(mark.x2, mark.y2)]),
            Some(MarkKind::Point) => entity.lines.push(circle(mark, POINT_M)),
            Some(MarkKind::Circle) => entity.lines.push(circle(mark, mark.x2)),
            Some(MarkKind::Text) => entity.texts.push(TextPrimitive {
                pose: Some(pose(&Pose2::new(mark.x, mark.y, 0.0))),
                billboard: true,
                font_size: LETTER_M,
                scale_invariant: false,
                color: Some(color),
                text: mark.text.as_str().to_owned(),
            }),
            Some(MarkKind::ImageLayer | MarkKind::RobotLayer) | None => {}
        }
    }
    if !ends.is_empty() {
        entity.lines.push(line(LineType::LineList, ends));
    }
    entity
}

fn color(layer: &LayerView<'_>) -> Color {
    let [r, g, b] = layer.color.map(|part| f64::from(part) / 255.0);
    Color { r, g, b, a: 1.0 }
}

fn at(mark: &OverlayMark) -> Point2 {
    Point2 { x: mark.x, y: mark.y }
}

fn to(mark: &OverlayMark) -> Point2 {
    Point2 { x: mark.x2, y: mark.y2 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use yamabico_core::overlay::Overlay;

    #[test]
    fn layers_go_to_the_schema_of_their_coordinates() {
        let mut overlay = Overlay::default();
        let (a, b) = (Vector2::new(1.0, 2.0), Vector2::new(3.0, 4.0));
        overlay.image("lines", [255, 0, 0]).line(a, b).line(b, a).point(a).circle(a, 5.0);
        overlay.robot("gate", [0, 255, 0]).polygon([a, b, a]).text(b, format_args!("0.5 m"));
        let header = OverlayHeader { stamp_ns: 7, ..OverlayHeader::default() };
        let image = annotations(&header, overlay.marks()).unwrap();
        assert_eq!(
            (image.points.len(), image.points[0].points.len()),
            (2, 4),
            "lines of a layer are one list"
        );
        assert_eq!((image.circles[0].diameter, image.texts.len()), (10.0, 0));
        assert_eq!(image.points[0].outline_color.unwrap().r, 1.0);
        let scene = scene("behaviors/a/overlay", &header, overlay.marks()).unwrap();
        assert_eq!((scene.entities.len(), scene.entities[0].id.as_str()), (1, "behaviors/a/overlay/gate"));
        assert_eq!(
            (scene.entities[0].lines[0].points.len(), scene.entities[0].texts[0].text.as_str()),
            (6, "0.5 m")
        );
        assert_eq!(scene.deletions[0].r#type, Deletion::All as i32);
    }

    #[test]
    fn an_overlay_without_layers_is_nothing() {
        let stray = [OverlayMark { kind: 3, ..OverlayMark::default() }];
        assert!(annotations(&OverlayHeader::default(), &stray).is_none());
        assert!(scene("t", &OverlayHeader::default(), &stray).is_none());
    }
}
