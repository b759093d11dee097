//! Places of labels beside the marks of a plot.

use super::figure::Pixel;

/// Rows of labels above and below a mark in which a free place is searched.
const MAX_ROWS: i32 = 8;
/// Distance between labels, px.
const GAP_PX: i32 = 8;
/// Distance of a label from a line that it avoids, px.
const LINE_GAP_PX: i32 = 8;

/// Rectangle, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rectangle {
    /// Left edge.
    pub left: i32,
    /// Upper edge.
    pub top: i32,
    /// Right edge, exclusive.
    pub right: i32,
    /// Lower edge, exclusive.
    pub bottom: i32,
}

impl Rectangle {
    /// Returns the square around `center` that extends `radius` px to each side.
    pub fn around(center: Pixel, radius: i32) -> Rectangle {
        let (x, y) = center;
        Rectangle { left: x - radius, top: y - radius, right: x + radius, bottom: y + radius }
    }

    fn overlaps(&self, other: &Rectangle) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn is_inside(&self, other: &Rectangle) -> bool {
        self.left >= other.left
            && self.right <= other.right
            && self.top >= other.top
            && self.bottom <= other.bottom
    }
}

/// Label in its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Label {
    /// Rectangle of the text.
    pub text: Rectangle,
    /// True if other labels lie between the mark and the label, so that a line should connect the two.
    pub is_remote: bool,
}

/// Chooses places for labels that hide neither each other nor a mark, and no line if there is a choice.
pub(super) struct Labels {
    area: Rectangle,
    marks: Vec<Rectangle>,
    /// Squares along all lines.
    lines: Vec<Rectangle>,
}

impl Labels {
    /// Creates an empty plot within `area`.
    pub fn new(area: Rectangle) -> Labels {
        Labels { area, marks: Vec::new(), lines: Vec::new() }
    }

    /// Adds a mark, which no label hides.
    pub fn add_mark(&mut self, mark: Rectangle) {
        self.marks.push(mark);
    }

    /// Adds a straight line, such as a wall or a part of a track.
    pub fn add_line(&mut self, from: Pixel, to: Pixel) {
        let (run, rise) = (to.0 - from.0, to.1 - from.1);
        let steps = (run.abs().max(rise.abs()) / LINE_GAP_PX).max(1);
        let points = (0..=steps).map(|step| (from.0 + run * step / steps, from.1 + rise * step / steps));
        self.lines.extend(points.map(|point| Rectangle::around(point, LINE_GAP_PX)));
    }

    /// Returns the place for a text of `width` x `height` px at `mark`: the nearest free one above or below it. Without a
    /// free place, the label is right above the mark.
    pub fn place(&mut self, mark: Rectangle, width: i32, height: i32) -> Label {
        let left = (mark.left + mark.right - width) / 2;
        let at = |row: i32, top: i32| Label {
            text: Rectangle { left, top, right: left + width, bottom: top + height },
            is_remote: row > 0,
        };
        let places = (0..MAX_ROWS).flat_map(|row| {
            let away = GAP_PX + row * (height + GAP_PX);
            [at(row, mark.top - away - height), at(row, mark.bottom + away)]
        });
        let is_free =
            |label: &Label, others: &[Rectangle]| !others.iter().any(|other| label.text.overlaps(other));
        let free: Vec<Label> =
            places.filter(|label| label.text.is_inside(&self.area) && is_free(label, &self.marks)).collect();
        let beside_lines = free.iter().find(|label| is_free(label, &self.lines));
        let label = beside_lines.or(free.first()).copied();
        let label = label.unwrap_or_else(|| at(0, mark.top - GAP_PX - height));
        self.marks.push(label.text);
        label
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AREA: Rectangle = Rectangle { left: 0, top: 0, right: 1000, bottom: 1000 };

    #[test]
    fn labels_of_close_marks_do_not_overlap() {
        let mut labels = Labels::new(AREA);
        let marks = [500, 510, 520, 530].map(|x| Rectangle::around((x, 500), 10));
        marks.iter().for_each(|mark| labels.add_mark(*mark));
        let placed = marks.map(|mark| labels.place(mark, 60, 28));
        for (i, label) in placed.iter().enumerate() {
            assert!(label.text.is_inside(&AREA));
            assert!(placed[..i].iter().all(|other| !other.text.overlaps(&label.text)), "{placed:?}");
            assert!(marks.iter().all(|mark| !mark.overlaps(&label.text)), "{placed:?}");
        }
        assert_eq!(placed.map(|label| label.is_remote), [false, false, true, true]);
    }

    #[test]
    fn a_label_avoids_lines_and_stays_in_the_area() {
        let mut labels = Labels::new(AREA);
        labels.add_line((400, 470), (600, 470));
        let mark = Rectangle::around((500, 500), 10);
        assert_eq!(labels.place(mark, 60, 28).text.top, 518, "below the mark, since the track is above");
        assert_eq!(labels.place(Rectangle::around((500, 5), 10), 60, 28).text.top, 23);
        let outside = labels.place(Rectangle::around((-500, 5), 10), 60, 28);
        assert_eq!(outside.text.bottom, -13);
    }
}
