//! Upright edges on the floor: steps of brightness along plumb lines, such as the sides of a box as bright as the floor.
//!
//! An edge on the floor could be mistaken for an upright one only if it points at the camera.

use nalgebra::{Point2, Vector2, Vector3};
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::geometry::angle_difference;
use yamabico_core::image::ImageView;

use super::hidden_fan::HiddenFan;
use super::picture_evidence::behind;
use crate::plumb_lines::{HALF_WIDTH_PX, PlumbLines};

/// Distance from the camera up to which feet are searched, m.
const MAX_RANGE_M: f64 = 2.4;
/// Height over which a step is averaged, m.
const HEIGHT_M: f64 = 0.25;
/// Smallest number of rows that a step is averaged over.
const MIN_ROWS: usize = 16;
/// Smallest step, gray levels.
const MIN_STEP: f64 = 7.0;
/// Parts of its rows that a step must be present in, and its smallest share there: an oblique edge crosses a line in few rows.
const PARTS: usize = 4;
const MIN_PART: f64 = 0.4;
/// Share of the step in the lowest part, of its maximum, from which a row belongs to the edge.
const FOOT_SHARE: f64 = 0.9;
/// Ratio of a step above another on the same line to it from which the lower one is the mirror image of the upper one: anywhere
/// above, and above a gap. Ratio below which there is a gap.
const MIRROR_RATIO: f64 = 1.3;
const MIRROR_RATIO_ABOVE_GAP: f64 = 0.7;
const GAP_RATIO: f64 = 0.25;
/// Distance before its foot from which an edge hides the floor, m.
const DEPTH_M: f64 = 0.03;
/// Angle to a direction within which an edge may be a line along it, rad.
const ALONG_RAD: f64 = 0.03;
/// Columns to each side in which only the strongest step counts.
const BESIDE: usize = 4;
/// Rows from the lower border up to which an edge is cut by it.
const CUT_ROWS: f64 = 3.0;
/// Columns between the upper and the lower end of an edge up to which it follows its plumb line: a line on the floor that passes
/// beside the camera is oblique.
const MAX_SLANT: usize = 1;

/// Lower end of an upright edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UprightEdge {
    /// Place on the floor below the lower end, robot frame, m; where the picture ends, if the edge does not end in it.
    pub foot: Point2<f64>,
    /// Lower end (column, row), and row of the upper end of what was averaged, px.
    pub pixel: Vector2<f64>,
    pub top_row: f64,
}

/// Finder of the upright edges in a picture, with its tables and buffers. Allocates when it is created and no more.
#[derive(Clone, Debug)]
pub(super) struct UprightEdges {
    pinhole: Pinhole,
    mount: Mount,
    lines: PlumbLines,
    /// Row of the upper end of an edge with its foot in each row; `None` if no foot is searched there.
    tops: Vec<Option<usize>>,
    /// Lowest edge of each line: its foot's row and its step.
    lowest: Vec<Option<(usize, f64)>>,
    found: Vec<UprightEdge>,
}

impl UprightEdges {
    /// Creates the finder of a camera; `None` if it sees no floor within range. Lens distortion is ignored.
    #[must_use]
    pub fn new(pinhole: &Pinhole, mount: &Mount) -> Option<Self> {
        let k = pinhole.intrinsics();
        let (width, height) = (k.width as usize, k.height as usize);
        let camera_from_body = mount.rotation_body_from_camera().transpose();
        let row_of = |ahead_m: f64| {
            let ahead = Vector3::new(mount.pan.cos(), mount.pan.sin(), 0.0) * ahead_m;
            let point = camera_from_body * (ahead - Vector3::new(0.0, 0.0, mount.z));
            (point.z > 1e-6).then(|| k.cy + k.fy * point.y / point.z)
        };
        let (horizon, farthest) = (row_of(1e6)?, row_of(MAX_RANGE_M)?.ceil().max(0.0));
        let sees_floor = mount.z > 0.0 && farthest + MIN_ROWS as f64 <= height as f64 - 1.0;
        if !sees_floor || width <= 2 * HALF_WIDTH_PX {
            return None;
        }
        // Rows that a thing of this height covers grow with the distance of its foot from the horizon.
        let top = |row: usize| {
            let rows = (row as f64 - horizon) * HEIGHT_M / mount.z;
            let top = (row as f64 - rows).round().max(0.0) as usize;
            (row as f64 >= farthest && top + MIN_ROWS <= row).then_some(top)
        };
        Some(Self {
            pinhole: *pinhole,
            mount: *mount,
            lines: PlumbLines::new(pinhole, mount, 0),
            tops: (0..height).map(top).collect(),
            lowest: vec![None; width],
            found: Vec::with_capacity(width),
        })
    }

    /// Takes in a picture; one of another size has no edges. Adds where the edges hide the floor to `hidden`.
    pub fn look(&mut self, image: ImageView, hidden: &mut HiddenFan) {
        self.found.clear();
        if !self.lines.sum(image, |_| 0) {
            return;
        }
        let Self { lines, tops, lowest, .. } = self;
        for (line, lowest) in lowest.iter_mut().enumerate() {
            *lowest = lowest_edge(lines, line, tops);
        }
        for line in HALF_WIDTH_PX..self.lines.count() - HALF_WIDTH_PX {
            if let Some((row, step)) = self.lowest[line]
                && self.is_strongest(line, step.abs())
                && self.is_plumb(line, row, step)
                && let Some(edge) = self.edge(line, row)
            {
                self.found.push(edge);
                hidden.hide(edge.foot, DEPTH_M);
            }
        }
    }

    /// Forgets the edges of the last picture.
    pub fn clear(&mut self) {
        self.found.clear();
    }

    /// Edges in the last picture, from left to right.
    pub fn found(&self) -> &[UprightEdge] {
        &self.found
    }

    /// Edges in the last picture that its lower border cuts.
    pub fn cut(&self) -> impl Iterator<Item = &UprightEdge> {
        let last = self.tops.len() as f64 - 1.0;
        self.found.iter().filter(move |edge| edge.pixel.y > last - CUT_ROWS)
    }

    /// Places on the floor at the feet of the edges in the last picture, and `cells_behind` cells behind each as seen from the
    /// camera, robot frame, m; without edges that may be a line on the floor in the direction `along` (rad), and those whose foot is not `counted`.
    pub fn feet(
        &self,
        along: f64,
        counted: impl Fn(Point2<f64>) -> bool,
        cells_behind: impl Fn(Point2<f64>) -> u8,
    ) -> impl Iterator<Item = Point2<f64>> {
        let off = |edge: &UprightEdge| edge.foot - self.camera();
        let counted = self.found.iter().filter(move |edge| {
            let off = off(edge);
            angle_difference(off.y.atan2(off.x), along).abs() > ALONG_RAD && counted(edge.foot)
        });
        counted.flat_map(move |edge| behind(edge.foot, off(edge), cells_behind(edge.foot)))
    }

    fn camera(&self) -> Point2<f64> {
        Point2::new(self.mount.x, self.mount.y)
    }

    /// True if no line beside this one has a stronger step; of equal ones the rightmost counts.
    fn is_strongest(&self, line: usize, step: f64) -> bool {
        let beside = line.saturating_sub(BESIDE)..(line + BESIDE + 1).min(self.lowest.len());
        beside.filter(|&other| other != line).all(|other| {
            self.lowest[other].is_none_or(|(_, there)| {
                let there = there.abs();
                there < step || (there == step && other < line)
            })
        })
    }

    /// True if an edge with its foot in this row has its upper and its lower end on the same line.
    fn is_plumb(&self, line: usize, row: usize, step: f64) -> bool {
        let Some(top) = self.tops[row] else { return false };
        let part = (row - top) / PARTS;
        let beside = line.saturating_sub(BESIDE)..=(line + BESIDE).min(self.lines.count() - 1);
        let strongest = |to: usize| {
            let share = |line: &usize| self.lines.mean(*line, to - part, to) / step;
            beside.clone().max_by(|a, b| share(a).total_cmp(&share(b))).unwrap_or(line)
        };
        strongest(row).abs_diff(strongest(top + part)) <= MAX_SLANT
    }

    fn edge(&self, line: usize, row: usize) -> Option<UprightEdge> {
        let pixel = Vector2::new(self.lines.column(line, row) as f64, row as f64);
        let ray = self.mount.rotation_body_from_camera() * self.pinhole.ray_from_pixel(pixel)?;
        let foot = self.camera() + ray.xy() * (self.mount.z / -ray.z);
        (ray.z < -1e-6).then_some(UprightEdge { foot, pixel, top_row: self.tops[row]? as f64 })
    }
}

/// Lowest row of a line where an edge ends, and its step; `None` if there is none, or only the mirror image of another.
fn lowest_edge(lines: &PlumbLines, line: usize, tops: &[Option<usize>]) -> Option<(usize, f64)> {
    let feet = tops.iter().enumerate().rev().map_while(|(row, top)| Some((row, (*top)?)));
    for (row, top) in feet {
        let step = lines.mean(line, top, row);
        if step.abs() < MIN_STEP {
            continue;
        }
        let part = (row - top) / PARTS;
        let share = |to: usize| lines.mean(line, to - part, to) / step;
        if (0..PARTS).all(|i| share(row - i * part) >= MIN_PART) {
            let above = (part..=top).rev().step_by((part / 2).max(1)).map(share);
            let is_mirror_image = is_repeated(above);
            // Below the foot the share of the lowest part declines.
            let ends = row - part..=row;
            let most = ends.clone().map(share).fold(0.0, f64::max);
            let foot = ends.rev().find(|&end| share(end) > FOOT_SHARE * most)?;
            return (!is_mirror_image).then_some((foot, step));
        }
    }
    None
}

/// True if the steps above another, upward and in relation to it, show what it is the mirror image of.
fn is_repeated(mut above: impl Iterator<Item = f64>) -> bool {
    let mut has_gap = false;
    above.any(|share| {
        has_gap |= share < GAP_RATIO;
        share > if has_gap { MIRROR_RATIO_ABOVE_GAP } else { MIRROR_RATIO }
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use yamabico_core::camera::Intrinsics;

    use super::*;

    const SIZE: (u32, u32) = (256, 240);
    const FLOOR: u8 = 120;

    fn camera() -> (Pinhole, Mount) {
        let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 1.1));
        (pinhole, Mount { x: 0.1, ..Mount::tilted(0.5, 0.2) })
    }

    /// Edges in a picture of floor that is brighter by `step` at each pixel.
    fn edges(mount: Mount, step: impl Fn(f64, f64) -> u8) -> Vec<UprightEdge> {
        look(mount, step).found().to_vec()
    }

    fn look(mount: Mount, step: impl Fn(f64, f64) -> u8) -> UprightEdges {
        let mut edges = UprightEdges::new(&camera().0, &mount).expect("sees the floor");
        let pixel = |i: u32| FLOOR + (i * 7 % 5) as u8 + step(f64::from(i % SIZE.0), f64::from(i / SIZE.0));
        let pixels: Vec<u8> = (0..SIZE.0 * SIZE.1).map(pixel).collect();
        let [width, height] = [SIZE.0, SIZE.1].map(|side| side as usize);
        let mut hidden = HiddenFan::new(edges.camera());
        edges.look(ImageView::new(&pixels, width, height, width).expect("an image"), &mut hidden);
        assert!(edges.found().iter().all(|edge| hidden.is_hidden(edge.foot)));
        edges
    }

    fn project(x: f64, y: f64, z: f64) -> Vector2<f64> {
        let (pinhole, mount) = camera();
        pinhole.project_from_body(&mount, &Point3::new(x, y, z)).expect("ahead of the camera")
    }

    /// True in a panel that stands across 1.5 m ahead, from `right_m` to `left_m`, 0.5 m high.
    fn is_panel(u: f64, v: f64, right_m: f64, left_m: f64) -> bool {
        let (lower, upper) = (project(1.5, 0.0, 0.0).y, project(1.5, 0.0, 0.5).y);
        let sides = [left_m, right_m].map(|y| {
            let (foot, top) = (project(1.5, y, 0.0), project(1.5, y, 0.5));
            foot.x + (top.x - foot.x) * (v - foot.y) / (top.y - foot.y)
        });
        (upper..lower).contains(&v) && (sides[0]..sides[1]).contains(&u)
    }

    #[test]
    fn both_sides_of_a_faint_panel_are_found_where_they_stand() {
        let panel = |step: u8| edges(camera().1, |u, v| if is_panel(u, v, -0.2, 0.15) { step } else { 0 });
        let found = panel(10);
        assert_eq!(found.len(), 2, "{found:?}");
        for (edge, y) in found.iter().zip([0.15, -0.2]) {
            let error_m = (edge.foot - Point2::new(1.5, y)).norm();
            assert!(error_m < 0.06, "{edge:?} is {error_m} m off");
        }
        assert_eq!(panel(5), [], "too faint");
    }

    #[test]
    fn what_lies_on_the_floor_has_no_upright_edge() {
        // A stripe along a hall, beside the camera, and a bar across it.
        let (near, far) = (project(0.9, 0.3, 0.0), project(3.0, 0.3, 0.0));
        let is_stripe = |u: f64, v: f64| {
            let left = near.x + (far.x - near.x) * (v - near.y) / (far.y - near.y);
            v > far.y && (left..left + 12.0).contains(&u)
        };
        let bar = project(1.6, 0.0, 0.0).y..project(1.3, 0.0, 0.0).y;
        for is_paint in [&is_stripe as &dyn Fn(f64, f64) -> bool, &|_, v| bar.contains(&v)] {
            assert_eq!(edges(camera().1, |u, v| if is_paint(u, v) { 60 } else { 0 }), []);
        }
    }

    #[test]
    fn a_mirror_image_below_a_brighter_window_does_not_count() {
        let level = Mount { tilt: 0.0, ..camera().1 };
        let count = |window: u8| {
            let found = edges(level, |u, v| match (110.0..150.0).contains(&u) {
                true if v < 40.0 => window,
                true if (140.0..230.0).contains(&v) => 20,
                _ => 0,
            });
            found.len()
        };
        assert_eq!((count(0), count(60), count(20)), (2, 0, 0));
    }

    #[test]
    fn an_edge_that_the_picture_cuts_has_its_foot_at_the_border() {
        let level = Mount { tilt: 0.0, ..camera().1 };
        let panel_to = |row: f64| {
            look(level, |u, v| if (110.0..150.0).contains(&u) && (60.0..row).contains(&v) { 40 } else { 0 })
        };
        let edges = panel_to(240.0);
        assert_eq!(edges.cut().count(), 2, "{:?}", edges.found());
        assert_eq!(edges.found().len(), 2);
        let edges = panel_to(230.0);
        assert_eq!(edges.cut().count(), 0, "{:?}", edges.found());
        assert_eq!(edges.found().len(), 2);
    }

    #[test]
    fn pictures_of_another_size_and_cameras_that_see_no_floor_have_no_edges() {
        let (pinhole, mount) = camera();
        let mut edges = UprightEdges::new(&pinhole, &mount).expect("sees the floor");
        let mut hidden = HiddenFan::new(edges.camera());
        edges.look(ImageView::new(&[0; 100], 10, 10, 10).expect("an image"), &mut hidden);
        assert_eq!(edges.found(), []);
        assert!(UprightEdges::new(&pinhole, &Mount::tilted(0.5, -1.0)).is_none());
        assert!(UprightEdges::new(&pinhole, &Mount::tilted(0.0, 0.2)).is_none());
    }
}
