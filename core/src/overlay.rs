//! Overlays: what a behavior saw, drawn over the message in which it saw it.
//!
//! A behavior draws through [`Outputs::draw`](crate::behavior::Outputs::draw), which does nothing without a viewer or recorder of overlays. An
//! [`Overlay`] consists of named layers of one color, in pixels of the camera's image or in the robot frame.
//!
//! ```
//! use nalgebra::Vector2;
//! use yamabico_core::overlay::{Overlay, Space, layers};
//!
//! let mut overlay = Overlay::default();
//! overlay.image("vanishing point", [255, 0, 255]).circle(Vector2::new(320.0, 200.0), 8.0);
//! overlay.robot("gate", [255, 160, 0]).line(Vector2::new(0.5, -0.3), Vector2::new(0.5, 0.3));
//! let drawn: Vec<_> = layers(overlay.marks()).map(|layer| (layer.name.to_string(), layer.space)).collect();
//! assert_eq!(drawn[0], ("vanishing point".to_owned(), Space::Image));
//! assert_eq!(drawn[1], ("gate".to_owned(), Space::Robot));
//! ```

use std::fmt;

use nalgebra::Vector2;

use crate::message::{MarkKind, Name, OverlayHeader, OverlayMark};
use crate::time::Time;

/// Maximum number of marks of one overlay, begins of layers included; further marks are counted and left out.
pub const MAX_MARKS: usize = 2048;

/// A color: red, green, blue.
pub type Color = [u8; 3];

/// Something that a behavior uses or accepts.
pub const GREEN: Color = [60, 220, 90];
/// An obstacle, or something that forbids a motion.
pub const RED: Color = [255, 60, 50];
/// A measurement before it is judged.
pub const YELLOW: Color = [255, 210, 0];
/// Something that a map or a model lets expect.
pub const BLUE: Color = [70, 150, 255];
/// The result: a direction, an aim or a target.
pub const MAGENTA: Color = [255, 70, 230];
/// A limit or a gate.
pub const ORANGE: Color = [255, 150, 30];
/// A second result, such as a lane or a weighted cell.
pub const CYAN: Color = [40, 215, 230];
/// Something that is seen and has no effect.
pub const GRAY: Color = [165, 165, 165];

/// Coordinates of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Space {
    /// Pixels of the frame, (right, down) from its upper left corner.
    Image,
    /// Robot frame, (forward, left), m.
    Robot,
}

/// Overlay of one call of a behavior. Its memory is bounded and allocated once.
#[derive(Clone, Debug)]
pub struct Overlay {
    slot: Name,
    stamp: Time,
    is_drawn: bool,
    omitted: u64,
    marks: Vec<OverlayMark>,
}

impl Default for Overlay {
    /// An empty overlay with room for [`MAX_MARKS`].
    fn default() -> Self {
        Overlay {
            slot: Name::default(),
            stamp: Time::ZERO,
            is_drawn: false,
            omitted: 0,
            marks: Vec::with_capacity(MAX_MARKS),
        }
    }
}

impl Overlay {
    /// Removes everything.
    pub fn clear(&mut self) {
        (self.is_drawn, self.omitted) = (false, 0);
        self.marks.clear();
    }

    /// Begins or continues the overlay of the message in `slot` with this stamp; marks over another message are removed.
    pub fn begin(&mut self, slot: &str, stamp: Time) {
        let slot = Name::new(slot);
        if !self.is_drawn || (self.slot, self.stamp) != (slot, stamp) {
            self.clear();
            (self.slot, self.stamp, self.is_drawn) = (slot, stamp, true);
        }
    }

    /// Begins a layer in pixels of the frame.
    pub fn image(&mut self, name: &str, color: Color) -> Layer<'_> {
        self.layer(MarkKind::ImageLayer, name, color)
    }

    /// Begins a layer in the robot frame.
    pub fn robot(&mut self, name: &str, color: Color) -> Layer<'_> {
        self.layer(MarkKind::RobotLayer, name, color)
    }

    /// Returns true if anything was drawn, even an overlay without marks, since the last [`Overlay::clear`].
    pub fn is_drawn(&self) -> bool {
        self.is_drawn
    }

    /// Slot of the message that is drawn over.
    pub fn slot(&self) -> &str {
        self.slot.as_str()
    }

    /// Header of the overlay; `topic` feeds its slot.
    pub fn header(&self, topic: &str, sequence: u64) -> OverlayHeader {
        OverlayHeader { stamp_ns: self.stamp.0, sequence, topic: topic.into(), omitted: self.omitted }
    }

    /// Marks in the order of drawing, each layer behind its begin.
    pub fn marks(&self) -> &[OverlayMark] {
        &self.marks
    }

    fn layer(&mut self, kind: MarkKind, name: &str, color: Color) -> Layer<'_> {
        let color = u32::from_be_bytes([0, color[0], color[1], color[2]]);
        self.push(OverlayMark { kind: kind.code(), color, text: name.into(), ..OverlayMark::default() });
        // Coordinates are rounded, so that a recording stays small.
        let steps = if kind == MarkKind::ImageLayer { 10.0 } else { 1000.0 };
        Layer { overlay: self, color, steps }
    }

    fn push(&mut self, mark: OverlayMark) {
        if self.marks.len() < MAX_MARKS {
            self.marks.push(mark);
        } else {
            self.omitted += 1;
        }
    }
}

/// A layer of an overlay that is being drawn. Pixels are rounded to 0.1, meters to 1 mm; marks that are not finite are left out.
pub struct Layer<'a> {
    overlay: &'a mut Overlay,
    color: u32,
    steps: f64,
}

impl Layer<'_> {
    /// Draws a point.
    pub fn point(&mut self, at: Vector2<f64>) -> &mut Self {
        self.mark(MarkKind::Point, at, Vector2::zeros(), Name::default())
    }

    /// Draws a line.
    pub fn line(&mut self, from: Vector2<f64>, to: Vector2<f64>) -> &mut Self {
        self.mark(MarkKind::Line, from, to, Name::default())
    }

    /// Draws lines between consecutive points.
    pub fn path(&mut self, points: impl IntoIterator<Item = Vector2<f64>>) -> &mut Self {
        let mut last = None;
        for point in points {
            if let Some(last) = last.replace(point) {
                self.line(last, point);
            }
        }
        self
    }

    /// Draws a closed polygon.
    pub fn polygon(&mut self, corners: impl IntoIterator<Item = Vector2<f64>>) -> &mut Self {
        let mut ends = None;
        for corner in corners {
            let first = match ends {
                Some((first, last)) => {
                    self.line(last, corner);
                    first
                }
                None => corner,
            };
            ends = Some((first, corner));
        }
        if let Some((first, last)) = ends {
            self.line(last, first);
        }
        self
    }

    /// Draws a box between two opposite corners.
    pub fn frame(&mut self, corner: Vector2<f64>, opposite: Vector2<f64>) -> &mut Self {
        let others = [Vector2::new(opposite.x, corner.y), Vector2::new(corner.x, opposite.y)];
        self.polygon([corner, others[0], opposite, others[1]])
    }

    /// Draws a circle.
    pub fn circle(&mut self, center: Vector2<f64>, radius: f64) -> &mut Self {
        self.mark(MarkKind::Circle, center, Vector2::new(radius, 0.0), Name::default())
    }

    /// Draws a text, truncated to 32 bytes; in a picture, `at` is its upper left corner.
    pub fn text(&mut self, at: Vector2<f64>, text: fmt::Arguments<'_>) -> &mut Self {
        let mut name = Name::default();
        // Writing to a `Text` cannot fail.
        let _ = fmt::Write::write_fmt(&mut name, text);
        self.mark(MarkKind::Text, at, Vector2::zeros(), name)
    }

    fn mark(&mut self, kind: MarkKind, from: Vector2<f64>, to: Vector2<f64>, text: Name) -> &mut Self {
        if from.iter().chain(&to).all(|value| value.is_finite()) {
            let [x, y, x2, y2] = [from.x, from.y, to.x, to.y].map(|v| (v * self.steps).round() / self.steps);
            self.overlay.push(OverlayMark { kind: kind.code(), color: self.color, x, y, x2, y2, text });
        }
        self
    }
}

/// A layer of a received overlay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerView<'a> {
    /// Name.
    pub name: &'a Name,
    /// Coordinates.
    pub space: Space,
    /// Color.
    pub color: Color,
    /// Marks.
    pub marks: &'a [OverlayMark],
}

/// Returns the layers of received marks; those before the first layer are left out.
pub fn layers(marks: &[OverlayMark]) -> impl Iterator<Item = LayerView<'_>> {
    let space = |mark: &OverlayMark| match mark.kind() {
        Some(MarkKind::ImageLayer) => Some(Space::Image),
        Some(MarkKind::RobotLayer) => Some(Space::Robot),
        _ => None,
    };
    let begins = marks.iter().enumerate().filter_map(move |(index, mark)| Some((index, space(mark)?)));
    begins.map(move |(index, space_of)| {
        let rest = &marks[index + 1..];
        let end = rest.iter().position(|mark| space(mark).is_some()).unwrap_or(rest.len());
        let [_, red, green, blue] = marks[index].color.to_be_bytes();
        LayerView {
            name: &marks[index].text,
            space: space_of,
            color: [red, green, blue],
            marks: &rest[..end],
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_come_back_with_their_marks() {
        let mut overlay = Overlay::default();
        overlay.begin("camera", Time(7));
        overlay.image("a", [1, 2, 3]).polygon([[0.0, 0.0], [4.04, 0.0], [4.0, 3.0]].map(Vector2::from));
        overlay.robot("empty", [9, 9, 9]);
        overlay.robot("b", [0, 0, 255]).text(Vector2::new(1.2345, f64::NAN), format_args!("left out"));
        overlay.robot("c", [0; 3]).text(Vector2::new(1.2345, 0.0), format_args!("{:.1} m", 0.52));
        let layers: Vec<_> = layers(overlay.marks()).collect();
        let counts: Vec<_> = layers.iter().map(|layer| (layer.name.as_str(), layer.marks.len())).collect();
        assert_eq!(counts, [("a", 3), ("empty", 0), ("b", 0), ("c", 1)]);
        assert_eq!(
            (layers[0].color, layers[0].space, layers[1].space),
            ([1, 2, 3], Space::Image, Space::Robot)
        );
        assert_eq!((layers[0].marks[0].x2, layers[3].marks[0].x), (4.0, 1.235));
        assert_eq!(layers[3].marks[0].text.as_str(), "0.5 m");
        let header = overlay.header("sensors/front", 3);
        assert_eq!((header.stamp_ns, header.topic.as_str(), overlay.slot()), (7, "sensors/front", "camera"));
    }

    #[test]
    fn memory_is_bounded_and_another_message_begins_anew() {
        let mut overlay = Overlay::default();
        overlay.begin("camera", Time(7));
        let mut layer = overlay.image("many", [0; 3]);
        for i in 0..3000 {
            layer.point(Vector2::new(f64::from(i), 0.0));
        }
        assert_eq!(
            (overlay.marks().len(), overlay.header("", 0).omitted),
            (MAX_MARKS, 3001 - MAX_MARKS as u64)
        );
        assert_eq!(overlay.marks.capacity(), MAX_MARKS);
        overlay.begin("camera", Time(7));
        assert_eq!(overlay.marks().len(), MAX_MARKS);
        overlay.begin("camera", Time(8));
        assert_eq!((overlay.marks().len(), overlay.header("", 0).omitted), (0, 0));
    }

    #[test]
    fn hostile_marks_are_no_layer() {
        let mark = |kind| OverlayMark { kind, ..OverlayMark::default() };
        assert_eq!(layers(&[mark(2), mark(99), mark(5)]).count(), 0);
        let mixed = [mark(3), mark(1), mark(77), mark(2)];
        let found: Vec<_> = layers(&mixed).collect();
        assert_eq!((found.len(), found[0].marks.len()), (1, 2), "unknown kinds stay for the reader to skip");
    }
}
