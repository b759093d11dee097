//! Rasterizer of an unrolled ring of a mirror image: a row per azimuth, a column per image radius.
//!
//! Along a row, visibility is exact to the crossing of two edges, as in the rows of a pinhole image, since the rays of a
//! half-plane meet in one point for any mirror. Rows are split at the corners of surfaces, so that upright edges are exact too.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::Vector2;
use yamabico_core::camera::{Meridian, Mirror};

use super::meridian::{Azimuth, InPlane, PosedMirror, Slice, VisibleFacets};
use super::project::Pass;
use super::raster::{MIRROR_SHRINK, Reflection};
use super::resolve::{Piece, Row};
use super::shade::{BACKGROUND_RADIANCE, BLOCK, Shader, SurfacePoints};
use super::spans::{Line, NOTHING};
use crate::Scene;

/// Maximum width of a scan line in rows: in general, and with a nearly radial edge.
const FINE: [f64; 2] = [0.55, 0.125];
/// The same for reflections, which are blurred.
const COARSE: [f64; 2] = [1.0, 1.0];
/// Minimum width of a scan line, rows; nearer corners share a line.
const MIN_LINE_ROWS: f64 = 0.02;
/// Maximum tangent of the elevation.
const MAX_TANGENT: f64 = 1e3;
/// Number of rows by which the reflection is rendered past either end of the circle, so that the blur is continuous.
const OVERLAP: usize = 4;

/// Sampling of a ring.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Number of rows around the circle; the first starts at azimuth 0.
    pub rows: usize,
    /// Image radius at the start of the first column, pixels.
    pub first_px: f64,
    /// Width of a column, pixels.
    pub column_px: f64,
    /// Number of columns.
    pub width: usize,
    columns: Columns,
    /// Tangents of the elevation at the inner and outer end.
    ends: [f64; 2],
    mirror: Mirror,
}

/// Directions of the column centers in their half-plane, followed by [`BLOCK`] additional columns.
#[derive(Clone, Debug, Default)]
struct Columns {
    out: Vec<f32>,
    up: Vec<f32>,
    /// Angle to the next image pixel outward, rad.
    turn: Vec<f32>,
    /// Angle to the next image pixel around the axis, rad.
    around: Vec<f32>,
}

impl Columns {
    #[inline(always)]
    fn block(&self, from: usize) -> [&[f32; BLOCK]; 4] {
        [&self.out, &self.up, &self.turn, &self.around].map(|list| part(list, from))
    }
}

#[inline(always)]
fn part(list: &[f32], from: usize) -> &[f32; BLOCK] {
    list[from..].first_chunk().unwrap_or(&[0.0; BLOCK])
}

/// Renderer of rings; reuses its buffers.
#[derive(Default)]
pub struct RingRenderer<const C: usize> {
    direct: VisibleFacets,
    mirrored: VisibleFacets,
    reflection: Reflection<C>,
    rasterizer: RowRasterizer<C>,
}

#[derive(Default)]
struct RowRasterizer<const C: usize> {
    slices: Vec<Slice>,
    cuts: Vec<f64>,
    /// True for rows with nearly radial edges.
    fine: Vec<bool>,
    line: Line,
    row: Row,
    pixels: Vec<[f32; C]>,
}

impl Grid {
    /// Returns a sampling with `rows` rows of `count` columns.
    #[must_use]
    pub fn new(
        mirror: &Mirror,
        rows: usize,
        first_px: f64,
        column_px: f64,
        count: usize,
        rim_px: f64,
    ) -> Self {
        let mut columns = Columns::default();
        let direction = |radius_px: f64| {
            let radius_px = radius_px.clamp(1e-3, rim_px);
            (radius_px, mirror.direction(radius_px).unwrap_or(Vector2::new(0.0, -1.0)))
        };
        for i in 0..count + BLOCK {
            let (radius_px, ray) = direction(first_px + (i as f64 + 0.5) * column_px);
            columns.out.push(ray.x as f32);
            columns.up.push(ray.y as f32);
            columns.turn.push((column_px * mirror.nadir_slope(radius_px)) as f32);
            columns.around.push((column_px / radius_px) as f32);
        }
        let ends = [first_px, first_px + count as f64 * column_px].map(|radius_px| {
            let (_, ray) = direction(radius_px);
            (ray.y / ray.x.max(1e-9)).clamp(-MAX_TANGENT, MAX_TANGENT)
        });
        Self { rows, first_px, column_px, width: count, columns, ends, mirror: mirror.clone() }
    }

    /// Returns the same ring with rows and columns wider by `factor`.
    fn coarse(&self, factor: usize, rim_px: f64) -> Self {
        let (rows, count) = (self.rows.div_ceil(factor), self.width.div_ceil(factor));
        Self::new(&self.mirror, rows, self.first_px, self.column_px * factor as f64, count, rim_px)
    }

    /// Returns the column coordinate of a tangent of the elevation; the first column covers 0 to 1.
    #[inline]
    fn column(&self, tangent: f64) -> f64 {
        let width = self.width as f64;
        let Some(radius_px) = self.mirror.radius_px(Vector2::new(1.0, tangent)) else { return width };
        ((radius_px - self.first_px) / self.column_px).clamp(0.0, width)
    }
}

/// Ring with the coarser sampling of the reflection on the floor.
#[derive(Clone, Debug)]
pub struct Ring {
    /// Sampling of the ring.
    pub grid: Grid,
    coarse: Grid,
}

impl Ring {
    /// Returns a ring with at least `rows` rows, rounded up to a multiple of [`MIRROR_SHRINK`].
    #[must_use]
    pub fn new(mirror: &Mirror, rows: usize, first_px: f64, count: usize, rim_px: f64) -> Self {
        let step = MIRROR_SHRINK as usize;
        let grid = Grid::new(mirror, rows.next_multiple_of(step), first_px, 1.0, count, rim_px);
        Self { coarse: grid.coarse(step, rim_px), grid }
    }
}

impl<const C: usize> RingRenderer<C> {
    /// Finds the visible facets for the rings that are rendered next.
    pub fn update(&mut self, scene: &Scene, posed: &PosedMirror) {
        let surfaces = scene.surfaces();
        self.direct.update(posed, surfaces, Pass::Direct);
        self.mirrored.clear();
        if posed.at.z > 0.0 && surfaces.iter().any(|s| s.material.gloss > 0.0) {
            self.mirrored.update(posed, surfaces, Pass::Mirrored);
        }
    }

    /// Computes the radiance of a ring, rows x columns, from azimuth 0 on.
    pub fn draw(&mut self, scene: &Scene, viewpoint: Vector2<f64>, ring: &Ring, out: &mut [[f32; C]]) {
        let Self { direct, mirrored, reflection, rasterizer } = self;
        reflection.clear();
        if !mirrored.facets.is_empty() {
            let (nothing, coarse) = (Reflection::default(), &ring.coarse);
            let (rows, overlap) = (coarse.rows as i64, OVERLAP as i64);
            reflection.begin(MIRROR_SHRINK, coarse.width, coarse.rows + 2 * OVERLAP);
            let seen =
                RingScene { scene, visible: mirrored, reflection: &nothing, viewpoint, line_rows: COARSE };
            rasterizer.pass(&seen, coarse, -overlap..rows + overlap, |_, row| reflection.push(row));
            reflection.blur();
        }
        let (rows, width) = (ring.grid.rows as i64, ring.grid.width);
        let seen = RingScene { scene, visible: direct, reflection, viewpoint, line_rows: FINE };
        rasterizer.pass(&seen, &ring.grid, 0..rows, |i, row| out[i * width..][..width].copy_from_slice(row));
    }
}

impl<const C: usize> RowRasterizer<C> {
    fn pass(
        &mut self,
        seen: &RingScene<'_, C>,
        grid: &Grid,
        rows: Range<i64>,
        mut take: impl FnMut(usize, &[[f32; C]]),
    ) {
        let RingScene { visible, reflection, viewpoint, line_rows, .. } = *seen;
        let Self { slices, cuts, fine, line, row, pixels } = self;
        let shaders: Vec<Shader<'_, C>> =
            visible.facets.iter().map(|f| Shader::new(seen.scene, f.surface)).collect();
        slices.clear();
        slices.resize(visible.facets.len(), Slice::default());
        pixels.clear();
        pixels.resize(grid.width, [BACKGROUND_RADIANCE; C]);
        let step = TAU / grid.rows as f64;
        fine.clear();
        fine.resize(grid.rows, false);
        for [start, extent] in &visible.oblique {
            let rows = (start / step) as usize..=((start + extent) / step) as usize;
            rows.for_each(|row| fine[row % grid.rows] = true);
        }
        for (index, number) in rows.enumerate() {
            row.clear(grid.width);
            let at = number.rem_euclid(grid.rows as i64);
            let widest = line_rows[usize::from(fine[at as usize])];
            cut(at as f64, step, &visible.corners, widest, cuts);
            for ends in cuts.windows(2) {
                let middle = 0.5 * (ends[0] + ends[1]);
                let azimuth = Azimuth::new(middle * step);
                let candidates = visible.around(middle * step);
                for &c in candidates {
                    let c = usize::from(c);
                    slices[c] = visible.facets[c].slice(azimuth, viewpoint);
                }
                line.scan(slices, candidates, 0.0, grid.ends);
                let last = line.stretches.len() - 1;
                for (i, stretch) in line.stretches.iter_mut().enumerate() {
                    stretch.start = match i {
                        0 => 0.0,
                        i if i == last => grid.width as f64,
                        _ => grid.column(stretch.start),
                    };
                }
                row.add(middle, (ends[1] - ends[0]) as f32, line);
            }
            let look = |polygon: u16, azimuth_rows: f64| {
                let p = usize::from(polygon);
                View::new(visible, &shaders[p], p, Azimuth::new(azimuth_rows * step), viewpoint)
            };
            row.pieces(|piece| match piece {
                Piece::Run { start, end, polygon } => {
                    let out = &mut pixels[start..end];
                    if polygon == NOTHING {
                        out.fill([BACKGROUND_RADIANCE; C]);
                    } else {
                        let place = [start as f32, index as f32 + 0.5];
                        look(polygon, at as f64 + 0.5).shade(&grid.columns, start, reflection, place, out);
                    }
                }
                Piece::Edge { x, parts } => {
                    let mut sum = [0.0; C];
                    for part in parts {
                        let mut one = [[BACKGROUND_RADIANCE; C]];
                        if part.polygon != NOTHING {
                            let place = [x as f32, index as f32 + 0.5];
                            look(part.polygon, f64::from(part.y)).shade(
                                &grid.columns,
                                x,
                                reflection,
                                place,
                                &mut one,
                            );
                        }
                        (0..C).for_each(|c| sum[c] += part.share * one[0][c]);
                    }
                    pixels[x] = sum;
                }
            });
            take(index, pixels);
        }
    }
}

/// Input of a rendering pass.
#[derive(Clone, Copy)]
struct RingScene<'a, const C: usize> {
    scene: &'a Scene,
    visible: &'a VisibleFacets,
    /// Reflection on the floor.
    reflection: &'a Reflection<C>,
    viewpoint: Vector2<f64>,
    /// [`FINE`] or [`COARSE`].
    line_rows: [f64; 2],
}

/// Splits row number `at` (`step` radians each) at the corners in it, into parts of at most `widest` rows.
fn cut(at: f64, step: f64, corners: &[f64], widest: f64, cuts: &mut Vec<f64>) {
    cuts.clear();
    cuts.push(at);
    let first = corners.partition_point(|c| *c <= at * step);
    let inside = corners[first..].iter().map(|c| c / step).take_while(|c| *c < at + 1.0 - MIN_LINE_ROWS);
    for end in inside.chain([at + 1.0]) {
        let start = cuts[cuts.len() - 1];
        if end - start < MIN_LINE_ROWS {
            continue;
        }
        let parts = ((end - start) / widest).ceil();
        cuts.extend((1..=parts as usize).map(|i| start + (end - start) * i as f64 / parts));
    }
}

/// One facet in one half-plane.
struct View<'a, const C: usize> {
    shader: &'a Shader<'a, C>,
    /// Signed distance from the viewpoint to the plane, m; negative on the visible side.
    height: f32,
    viewpoint_out: f32,
    normal: [f32; 3],
    axes: [[f32; 3]; 2],
    /// Surface coordinates of the projection of the viewpoint onto the plane.
    foot: [f32; 2],
}

impl<'a, const C: usize> View<'a, C> {
    fn new(
        visible: &VisibleFacets,
        shader: &'a Shader<'a, C>,
        facet: usize,
        azimuth: Azimuth,
        viewpoint: Vector2<f64>,
    ) -> Self {
        let facet = &visible.facets[facet];
        let single = |p: InPlane| [p.out as f32, p.up as f32, p.aside as f32];
        let normal = azimuth.split(&facet.normal);
        let axes = facet.axes.map(|axis| azimuth.split(&axis));
        let foot = [0, 1].map(|k| {
            let axis = &axes[k];
            (axis.out * viewpoint.x + axis.up * viewpoint.y - facet.axes[k].dot(&facet.origin)) as f32
        });
        Self {
            shader,
            height: facet.height(normal, viewpoint) as f32,
            viewpoint_out: viewpoint.x as f32,
            normal: single(normal),
            axes: axes.map(single),
            foot,
        }
    }

    /// Computes the radiance in the columns from `first` on; `place` is the column and row in the ring, for the reflection.
    fn shade(
        &self,
        columns: &Columns,
        first: usize,
        reflection: &Reflection<C>,
        place: [f32; 2],
        out: &mut [[f32; C]],
    ) {
        let shader = self.shader;
        if shader.emission > 0.0 {
            out.fill([shader.emission; C]);
            return;
        }
        let glossy = shader.gloss > 0.0 && !reflection.is_empty();
        let (n, [a, b]) = (&self.normal, &self.axes);
        for (block, pixels) in out.chunks_mut(BLOCK).enumerate() {
            let from = first + block * BLOCK;
            let count = pixels.len();
            let mut points = SurfacePoints::default();
            let mut cosine = [1.0; BLOCK];
            let [outs, ups, turns, arounds] = columns.block(from);
            for (i, cosine) in cosine.iter_mut().enumerate() {
                let (along, up, turn, around) = (outs[i], ups[i], turns[i], arounds[i]);
                let approach = (n[0] * along + n[1] * up).min(-1e-6);
                let reach = (self.height / approach).clamp(0.0, 1e3);
                *cosine = -approach;
                // Derivatives of the hit point toward the next column, and toward the next pixel around the axis.
                let tilt = (n[1] * along - n[0] * up) / approach;
                let (sway, aside) = (reach * turn, (self.viewpoint_out + reach * along) * around);
                let lean = n[2] / approach;
                let at = |axis: &[f32; 3]| {
                    let here = axis[0] * along + axis[1] * up;
                    let radial = sway * (axis[1] * along - axis[0] * up - here * tilt);
                    let tangential = aside * (axis[2] - here * lean);
                    (here, radial.abs() + tangential.abs())
                };
                let ((u, du), (v, dv)) = (at(a), at(b));
                points.u[i] = self.foot[0] + reach * u;
                points.v[i] = self.foot[1] + reach * v;
                points.du[i] = du;
                points.dv[i] = dv;
            }
            let irradiance = shader.irradiance(&points, count);
            for (pixel, irradiance) in pixels.iter_mut().zip(irradiance) {
                *pixel = shader.albedo.map(|albedo| albedo * irradiance);
            }
            if glossy {
                for (i, pixel) in pixels.iter_mut().enumerate() {
                    let share = shader.reflection(cosine[i]);
                    let row = place[1] + (OVERLAP * MIRROR_SHRINK as usize) as f32;
                    let seen = reflection.at(place[0] + (block * BLOCK + i) as f32 + 0.5, row);
                    for (p, s) in pixel.iter_mut().zip(seen) {
                        *p += share * (s - *p);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_split_at_corners_with_a_minimum_width() {
        let mut cuts = Vec::new();
        cut(4.0, 0.1, &[0.1, 0.43, 0.4301, 0.46, 0.52], 0.55, &mut cuts);
        let expected = [4.0, 4.3, 4.6, 5.0];
        assert!(cuts.len() == 4 && cuts.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{cuts:?}");
        cut(0.0, 0.1, &[], 0.55, &mut cuts);
        assert_eq!(cuts, [0.0, 0.5, 1.0]);
    }
}
