//! Prediction of the map edges visible to a camera at a given pose.

use nalgebra::{Point2, Point3, Vector2};

use super::view::{ClippedEdge, MapView};
use super::wire_frame::{Edge, EdgeKind, EdgeRole, Wall, WireFrame};
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Mount, Pinhole};

/// Sine of the angle below which edges are parallel in the image (3 degrees).
const PARALLEL_SINE: f64 = 0.052;

/// Criteria for omitting edges that are in view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectationRules {
    /// Minimum length of an edge in the image, pixels.
    pub min_length_px: f64,
    /// Maximum distance of an edge, m.
    pub farthest_m: f64,
    /// Minimum distance between two parallel edges in the image, pixels. Closer edges are ambiguous and both omitted,
    /// except that a detail is omitted in favor of an outline. 0 keeps all.
    pub min_gap_px: f64,
    /// Minimum distance of a horizontal edge's vertical plane from the camera, m: edges in a plane through the camera
    /// carry no information. 0 keeps all.
    pub grazing_m: f64,
    /// Spacing of the visibility tests along an edge that is not vertical, pixels.
    pub sample_px: f64,
}

impl Default for ExpectationRules {
    /// For an image 640 px wide.
    fn default() -> Self {
        Self { min_length_px: 20.0, farthest_m: 15.0, min_gap_px: 4.0, grazing_m: 0.05, sample_px: 8.0 }
    }
}

impl ExpectationRules {
    /// Rules for an image of this width: the minimum length scales with it, down to 10 pixels.
    #[must_use]
    pub fn for_width(width: u32) -> Self {
        Self { min_length_px: (20.0 * f64::from(width) / 640.0).clamp(10.0, 20.0), ..Self::default() }
    }

    /// Rules that keep every edge in view.
    #[must_use]
    pub fn everything() -> Self {
        Self {
            min_length_px: 0.0,
            farthest_m: f64::INFINITY,
            min_gap_px: 0.0,
            grazing_m: 0.0,
            ..Self::default()
        }
    }
}

/// Edge of the map, or a visible part of one, projected into the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedEdge {
    /// Index of the edge in the map.
    pub edge: usize,
    /// Orientation of the edge in space.
    pub kind: EdgeKind,
    /// Visual prominence of the edge.
    pub role: EdgeRole,
    /// First endpoint, in the edge's order, undistorted pixels inside the image.
    pub from: Vector2<f64>,
    /// Second endpoint, undistorted pixels inside the image.
    pub to: Vector2<f64>,
    /// Horizontal distance from the camera to the nearer end, m.
    pub range_m: f64,
    /// Depth of the nearer end along the optical axis, m.
    pub depth_m: f64,
}

impl ExpectedEdge {
    /// Distance between the endpoints, pixels.
    #[must_use]
    pub fn length_px(&self) -> f64 {
        (self.to - self.from).norm()
    }
}

/// Computes the visible edges of a map. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct ExpectationMap {
    rules: ExpectationRules,
    expected: Vec<ExpectedEdge>,
    hiding: Vec<Wall>,
    is_close: Vec<bool>,
}

impl ExpectationMap {
    /// Creates an expectation map that omits edges by `rules`.
    #[must_use]
    pub fn new(rules: ExpectationRules) -> Self {
        Self { rules, ..Self::default() }
    }

    /// Rules for omitting edges.
    #[must_use]
    pub fn rules(&self) -> &ExpectationRules {
        &self.rules
    }

    /// Computes the edges of `map` visible to a camera on a robot at `map_from_robot`, in the map's order. An edge that
    /// is hidden in the middle is split into parts. Ignores lens distortion: pixels are undistorted. Empty if nothing
    /// is in view or the pose is not finite.
    ///
    /// Visibility is tested in plan: once for a vertical edge, every `sample_px` along others.
    pub fn compute(
        &mut self,
        map: &WireFrame,
        camera: &Pinhole,
        mount: &Mount,
        map_from_robot: &Pose2,
    ) -> &[ExpectedEdge] {
        self.expected.clear();
        if map_from_robot.is_finite() {
            let view = MapView::new(camera.intrinsics(), mount, map_from_robot);
            for (index, edge) in map.edges().iter().enumerate() {
                self.expect(index, edge, map.walls(), &view);
            }
            self.drop_close_pairs();
        }
        &self.expected
    }

    /// Edges of the last call of [`ExpectationMap::compute`].
    #[must_use]
    pub fn expected(&self) -> &[ExpectedEdge] {
        &self.expected
    }

    fn expect(&mut self, index: usize, edge: &Edge, walls: &[Wall], view: &MapView) {
        let camera = view.plan_position();
        if self.is_grazed(edge, camera) {
            return;
        }
        let Some(clipped) = view.clip(edge) else { return };
        let length_px = (clipped.pixels[1] - clipped.pixels[0]).norm();
        if length_px.is_nan() || length_px < self.rules.min_length_px {
            return;
        }
        let [near, far] = clipped.points_in_camera.map(|point| view.plan_of(&point));
        if (near - camera).norm().min((far - camera).norm()) > self.rules.farthest_m {
            return;
        }
        if edge.kind == EdgeKind::Vertical {
            if view.is_visible(near, walls) {
                self.keep(index, edge, &clipped, [0.0, 1.0], view);
            }
            return;
        }
        self.hiding.clear();
        self.hiding.extend(walls.iter().filter(|wall| may_be_in_triangle(wall, camera, near, far)));
        if self.hiding.is_empty() {
            self.keep(index, edge, &clipped, [0.0, 1.0], view);
        } else {
            self.keep_visible_runs(index, edge, &clipped, length_px, view);
        }
    }

    fn keep_visible_runs(
        &mut self,
        index: usize,
        edge: &Edge,
        clipped: &ClippedEdge,
        length_px: f64,
        view: &MapView,
    ) {
        let steps = (length_px / self.rules.sample_px).ceil().clamp(1.0, 4096.0) as usize;
        let mut begin: Option<f64> = None;
        let mut last = 0.0;
        for step in 0..=steps {
            let share = step as f64 / steps as f64;
            let is_seen = view.is_visible(view.plan_of(&interpolate(clipped, share)), &self.hiding);
            match (begin, is_seen) {
                (None, true) => begin = Some(share),
                (Some(from), false) => {
                    self.keep(index, edge, clipped, [from, last], view);
                    begin = None;
                }
                _ => {}
            }
            last = share;
        }
        if let Some(from) = begin {
            self.keep(index, edge, clipped, [from, 1.0], view);
        }
    }

    fn keep(&mut self, index: usize, edge: &Edge, clipped: &ClippedEdge, shares: [f64; 2], view: &MapView) {
        let [p, q] = clipped.pixels;
        let [from, to] = shares.map(|share| p + (q - p) * share);
        if (to - from).norm() < self.rules.min_length_px {
            return;
        }
        let ends = shares.map(|share| interpolate(clipped, share));
        let camera = view.plan_position();
        let range_m = ends.map(|end| (view.plan_of(&end) - camera).norm());
        let range_m = range_m[0].min(range_m[1]);
        if range_m <= self.rules.farthest_m {
            let depth_m = ends[0].z.min(ends[1].z);
            let Edge { kind, role, .. } = *edge;
            self.expected.push(ExpectedEdge { edge: index, kind, role, from, to, range_m, depth_m });
        }
    }

    fn is_grazed(&self, edge: &Edge, camera: Point2<f64>) -> bool {
        let run = (edge.to - edge.from).xy();
        edge.kind != EdgeKind::Vertical
            && (camera - edge.from.xy()).perp(&run).abs() < self.rules.grazing_m * run.norm()
    }

    fn drop_close_pairs(&mut self) {
        let gap_px = self.rules.min_gap_px;
        if gap_px <= 0.0 {
            return;
        }
        self.is_close.clear();
        self.is_close.resize(self.expected.len(), false);
        for (i, a) in self.expected.iter().enumerate() {
            for (j, b) in self.expected.iter().enumerate().skip(i + 1) {
                if a.edge != b.edge && are_close(a, b, gap_px) {
                    self.is_close[i] |= !is_distinguishable(a, b);
                    self.is_close[j] |= !is_distinguishable(b, a);
                }
            }
        }
        let mut is_close = self.is_close.iter();
        self.expected.retain(|_| is_close.next() == Some(&false));
    }
}

/// Returns true if `a` remains distinguishable next to `b`.
fn is_distinguishable(a: &ExpectedEdge, b: &ExpectedEdge) -> bool {
    a.role == EdgeRole::Outline && b.role == EdgeRole::Detail
}

/// Point in the optical frame at a share of the distance between both ends in the image.
fn interpolate(clipped: &ClippedEdge, share: f64) -> Point3<f64> {
    let [a, b] = clipped.points_in_camera;
    a + (b - a) * (share * a.z / (b.z + share * (a.z - b.z)))
}

/// Returns true if part of the wall may lie inside the triangle of the camera and the ends of an edge.
fn may_be_in_triangle(wall: &Wall, camera: Point2<f64>, near: Point2<f64>, far: Point2<f64>) -> bool {
    let orientation = (near - camera).perp(&(far - camera)).signum();
    [(camera, near), (near, far), (far, camera)].iter().all(|(start, end)| {
        let side = (end - start) * orientation;
        side.perp(&(wall.from - start)) > 0.0 || side.perp(&(wall.to - start)) > 0.0
    })
}

/// Returns true if two edges are parallel, overlap by half of the shorter one, and are closer than `gap_px` on average.
fn are_close(a: &ExpectedEdge, b: &ExpectedEdge, gap_px: f64) -> bool {
    let (run_a, run_b) = (a.to - a.from, b.to - b.from);
    let (length_a, length_b) = (run_a.norm(), run_b.norm());
    if run_a.perp(&run_b).abs() > PARALLEL_SINE * length_a * length_b {
        return false;
    }
    let (long, run, length, short) =
        if length_a >= length_b { (a, run_a, length_a, b) } else { (b, run_b, length_b, a) };
    let direction = run / length;
    let distance = |p: Vector2<f64>| direction.perp(&(p - long.from));
    let (d0, d1) = (distance(short.from), distance(short.to));
    if 0.5 * (d0 + d1).abs() >= gap_px {
        return false;
    }
    let position = |p: Vector2<f64>| direction.dot(&(p - long.from));
    let (s0, s1) = (position(short.from), position(short.to));
    let overlap = s0.max(s1).min(length) - s0.min(s1).max(0.0);
    overlap > 0.5 * (s1 - s0).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_geometry::camera::Intrinsics;

    fn camera() -> (Pinhole, Mount) {
        (Pinhole::ideal(Intrinsics::from_horizontal_fov(640, 480, 60_f64.to_radians())), Mount::level(0.6))
    }

    fn edge(a: [f64; 3], b: [f64; 3]) -> Edge {
        Edge::between(Point3::from(a), Point3::from(b))
    }

    fn wall(a: [f64; 2], b: [f64; 2]) -> Wall {
        Wall { from: Point2::from(a), to: Point2::from(b) }
    }

    fn expected(map: &WireFrame, rules: ExpectationRules) -> Vec<ExpectedEdge> {
        let (camera, mount) = camera();
        ExpectationMap::new(rules).compute(map, &camera, &mount, &Pose2::IDENTITY).to_vec()
    }

    #[test]
    fn a_pillar_cuts_a_line_in_two() {
        let lines = vec![edge([5.0, -2.0, 1.0], [5.0, 2.0, 1.0])];
        let walls = vec![wall([3.0, -0.2], [3.0, 0.2])];
        let parts = expected(&WireFrame::new(lines, walls), ExpectationRules::default());
        assert_eq!(parts.iter().map(|part| part.edge).collect::<Vec<_>>(), [0, 0]);
        // The pillar's edges project to f * 0.2/3 on either side of the center.
        let hidden_px = 554.256 * 0.2 / 3.0;
        for part in &parts {
            let inner = (part.from.x - 319.5).abs().min((part.to.x - 319.5).abs());
            assert!((hidden_px..hidden_px + 9.0).contains(&inner), "{part:?}");
            assert!((part.depth_m - 5.0).abs() < 1e-9);
        }
    }

    #[test]
    fn neighbors_too_close_to_tell_apart_are_both_left_out() {
        let lines = vec![
            edge([6.0, 1.0, 0.0], [6.0, 1.0, 2.0]),
            edge([6.0, 1.03, 0.0], [6.0, 1.03, 2.0]),
            edge([6.0, -1.0, 0.0], [6.0, -1.0, 2.0]),
        ];
        let map = WireFrame::new(lines, Vec::new());
        let indices = |rules| expected(&map, rules).iter().map(|part| part.edge).collect::<Vec<_>>();
        assert_eq!(indices(ExpectationRules::default()), [2]);
        assert_eq!(indices(ExpectationRules::everything()), [0, 1, 2]);
        let mut lines = map.edges().to_vec();
        lines[1] = lines[1].detail();
        let parts = expected(&WireFrame::new(lines, Vec::new()), ExpectationRules::default());
        assert_eq!(parts.iter().map(|part| part.edge).collect::<Vec<_>>(), [0, 2], "the detail yields");
    }

    #[test]
    fn short_far_and_grazing_edges_are_left_out() {
        let lines = vec![
            edge([8.0, 0.5, 0.5], [8.0, 0.5, 0.7]),
            edge([20.0, 0.0, 0.0], [20.0, 0.0, 2.5]),
            edge([2.0, 0.03, 1.0], [9.0, 0.03, 1.0]),
            edge([2.0, 0.1, 0.0], [9.0, 0.1, 0.0]),
        ];
        let map = WireFrame::new(lines, Vec::new());
        let kept: Vec<_> = expected(&map, ExpectationRules::default()).iter().map(|part| part.edge).collect();
        assert_eq!(kept, [3]);
        assert_eq!(expected(&map, ExpectationRules::everything()).len(), 4);
    }

    #[test]
    fn an_empty_view_and_an_invalid_pose_are_empty() {
        let map = WireFrame::new(vec![edge([-6.0, 1.0, 0.0], [-6.0, 1.0, 2.0])], Vec::new());
        assert!(expected(&map, ExpectationRules::everything()).is_empty());
        let (camera, mount) = camera();
        let nowhere = Pose2 { x: f64::NAN, ..Pose2::IDENTITY };
        assert!(ExpectationMap::default().compute(&map, &camera, &mount, &nowhere).is_empty());
    }
}
