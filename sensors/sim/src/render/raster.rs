//! Rasterizer of polygons, row by row.

use yamabico_core::camera::Intrinsics;

use super::project::{Linear, Pass, Polygon, PosedPinhole};
use super::resolve::{Piece, Row};
use super::shade::{BACKGROUND_RADIANCE, BLOCK, Shader, SurfacePoints};
use super::spans::{Line, NOTHING};
use crate::Scene;

/// Number of scan lines per row.
const LINES: usize = 4;
/// Factor by which the image of the reflected world is smaller, in width and height.
pub const MIRROR_SHRINK: u32 = 4;
/// Maximum radiance in a blurred reflection.
pub const MAX_BLURRED_RADIANCE: f32 = 4.0;

/// Rasterizer of images with `C` channels; reuses its buffers.
#[derive(Default)]
pub struct Raster<const C: usize> {
    polygons: Vec<Polygon>,
    active: Vec<u16>,
    line: Line,
    row: Row,
    pixels: Vec<[f32; C]>,
    mirror: Reflection<C>,
}

/// Image of the world reflected by the floor: small and blurred, or sharp.
#[derive(Default)]
pub struct Reflection<const C: usize> {
    /// Factor by which it is smaller than the image, in width and height.
    shrink: u32,
    width: usize,
    height: usize,
    pixels: Vec<[f32; C]>,
    spare: Vec<[f32; C]>,
}

impl<const C: usize> Raster<C> {
    /// Rasterizes the scene, and calls `take` with the radiance of every row, from top to bottom.
    pub fn draw(
        &mut self,
        scene: &Scene,
        posed: &PosedPinhole,
        mut take: impl FnMut(usize, &[[f32; C]], &Intrinsics),
    ) {
        let mirrors = scene.surfaces().iter().any(|s| s.material.gloss > 0.0);
        self.mirror.width = 0;
        if mirrors && posed.at.z > 0.0 {
            let is_sharp = scene.mirrors_sharply();
            let small = posed.shrunk(if is_sharp { 1 } else { MIRROR_SHRINK });
            let (width, height) = (small.intrinsics.width as usize, small.intrinsics.height as usize);
            let mut mirror = std::mem::take(&mut self.mirror);
            mirror.begin(if is_sharp { 1 } else { MIRROR_SHRINK }, width, height);
            // No floor above the horizon: its rows stay empty.
            let first =
                if is_sharp { (0..height).find(|y| small.looks_down(*y)).unwrap_or(height) } else { 0 };
            mirror.pixels.resize(first * width, [0.0; C]);
            self.pass(scene, &small, Pass::Mirrored, first, |_, row, _| mirror.push(row));
            if !is_sharp {
                mirror.blur();
            }
            self.mirror = mirror;
        }
        self.pass(scene, posed, Pass::Direct, 0, &mut take);
    }

    fn pass(
        &mut self,
        scene: &Scene,
        posed: &PosedPinhole,
        pass: Pass,
        first_row: usize,
        mut take: impl FnMut(usize, &[[f32; C]], &Intrinsics),
    ) {
        posed.project(scene.surfaces(), pass, &mut self.polygons);
        self.polygons.truncate(usize::from(NOTHING) - 1);
        let shaders: Vec<Shader<'_, C>> =
            self.polygons.iter().map(|p| Shader::new(scene, p.surface)).collect();
        let (width, height) = (posed.intrinsics.width as usize, posed.intrinsics.height as usize);
        self.pixels.clear();
        self.pixels.resize(width, [0.0; C]);
        for y in first_row..height {
            let top = y as f64;
            self.active.clear();
            let crossing =
                self.polygons.iter().enumerate().filter(|(_, p)| p.y[0] < top + 1.0 && p.y[1] > top);
            self.active.extend(crossing.map(|(i, _)| i as u16));
            self.row.clear(width);
            for l in 0..LINES {
                let line_y = top + (l as f64 + 0.5) / LINES as f64;
                self.line.scan(&self.polygons, &self.active, line_y, [0.0, width as f64]);
                self.row.add(line_y, (LINES as f32).recip(), &self.line);
            }
            let (polygons, pixels, mirror) = (&self.polygons, &mut self.pixels, &self.mirror);
            self.row.pieces(|piece| match piece {
                Piece::Run { start, end, polygon } => {
                    let out = &mut pixels[start..end];
                    if polygon == NOTHING {
                        out.fill([BACKGROUND_RADIANCE; C]);
                    } else {
                        let p = usize::from(polygon);
                        let from = [start as f32 + 0.5, y as f32 + 0.5];
                        shade(&polygons[p], &shaders[p], mirror, posed, from, out);
                    }
                }
                Piece::Edge { x, parts } => {
                    let mut sum = [0.0; C];
                    for part in parts {
                        let mut one = [[BACKGROUND_RADIANCE; C]];
                        if part.polygon != NOTHING {
                            let p = usize::from(part.polygon);
                            shade(&polygons[p], &shaders[p], mirror, posed, [part.x, part.y], &mut one);
                        }
                        for c in 0..C {
                            sum[c] += part.share * one[0][c];
                        }
                    }
                    pixels[x] = sum;
                }
            });
            take(y, &self.pixels, &posed.intrinsics);
        }
    }
}

/// Computes the radiance of a polygon at the image points `from`, one pixel to the right, and so on.
fn shade<const C: usize>(
    polygon: &Polygon,
    shader: &Shader<'_, C>,
    mirror: &Reflection<C>,
    posed: &PosedPinhole,
    from: [f32; 2],
    out: &mut [[f32; C]],
) {
    if shader.emission > 0.0 {
        out.fill([shader.emission; C]);
        return;
    }
    let y = f64::from(from[1]);
    let row = |l: &Linear| ((l[1] * y + l[2]) as f32, l[0] as f32, l[1] as f32);
    let (w0, wx, wy) = row(&polygon.inverse_depth);
    let (u0, ux, uy) = row(&polygon.u);
    let (v0, vx, vy) = row(&polygon.v);
    let k = &posed.intrinsics;
    let ray_y = ((y - 0.5 - k.cy) / k.fy) as f32;
    let (center, per_pixel) = ((k.cx + 0.5) as f32, (1.0 / k.fx) as f32);
    let glossy = shader.gloss > 0.0 && mirror.width > 0;
    for (block, pixels) in out.chunks_mut(BLOCK).enumerate() {
        let start = from[0] + (block * BLOCK) as f32;
        let mut points = SurfacePoints::default();
        let mut depth = [0.0; BLOCK];
        for (i, depth) in depth.iter_mut().enumerate() {
            let x = start + i as f32;
            let z = 1.0 / (w0 + wx * x).max(1e-6);
            let (u, v) = ((u0 + ux * x) * z, (v0 + vx * x) * z);
            *depth = z;
            points.u[i] = u;
            points.v[i] = v;
            points.du[i] = ((ux - u * wx).abs() + (uy - u * wy).abs()) * z;
            points.dv[i] = ((vx - v * wx).abs() + (vy - v * wy).abs()) * z;
        }
        let irradiance = shader.irradiance(&points, pixels.len());
        for (pixel, irradiance) in pixels.iter_mut().zip(irradiance) {
            *pixel = shader.albedo.map(|a| a * irradiance);
        }
        if glossy {
            for (i, pixel) in pixels.iter_mut().enumerate() {
                let x = start + i as f32;
                let ray_x = (x - center) * per_pixel;
                let length = depth[i] * (1.0 + ray_x * ray_x + ray_y * ray_y).sqrt();
                let share = shader.reflection(posed.at.z as f32 / length);
                let seen = mirror.at(x, from[1]);
                for (p, s) in pixel.iter_mut().zip(seen) {
                    *p += share * (s - *p);
                }
            }
        }
    }
}

impl<const C: usize> Reflection<C> {
    /// Removes the reflection.
    pub fn clear(&mut self) {
        self.width = 0;
        self.pixels.clear();
    }

    /// Returns true if there is no reflection.
    pub fn is_empty(&self) -> bool {
        self.width == 0
    }

    /// Starts an image of this size, smaller by `shrink`, to be filled by [`Reflection::push`].
    pub fn begin(&mut self, shrink: u32, width: usize, height: usize) {
        (self.shrink, self.width, self.height) = (shrink, width, height);
        self.pixels.clear();
    }

    /// Appends a row.
    pub fn push(&mut self, row: &[[f32; C]]) {
        self.pixels.extend_from_slice(row);
    }

    /// Applies a box blur of 3 x 5 pixels (width x height), since no floor is perfectly flat.
    pub fn blur(&mut self) {
        let (w, h) = (self.width, self.height);
        // Clipped, since far brighter pixels would saturate their neighborhood.
        self.pixels.iter_mut().flatten().for_each(|p| *p = p.min(MAX_BLURRED_RADIANCE));
        for (step, length, reach) in [(1, w, 1_usize), (w, h, 2)] {
            self.spare.clear();
            for i in 0..w * h {
                let at = i / step % length;
                let (low, high) = (at.saturating_sub(reach), (at + reach).min(length - 1));
                let mut sum = [0.0; C];
                for j in low..=high {
                    let q = i + j * step - at * step;
                    (0..C).for_each(|c| sum[c] += self.pixels[q][c]);
                }
                let share = ((high - low + 1) as f32).recip();
                self.spare.push(sum.map(|s| s * share));
            }
            std::mem::swap(&mut self.pixels, &mut self.spare);
        }
    }

    /// Interpolates bilinearly at a point of the full-size image.
    pub fn at(&self, x: f32, y: f32) -> [f32; C] {
        let cell = |t: f32, n: usize| {
            let t = (t / self.shrink as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            let i = (t as usize).min(n.saturating_sub(2));
            (i, (i + 1).min(n - 1), t - i as f32)
        };
        let (x0, x1, fx) = cell(x, self.width);
        let (y0, y1, fy) = cell(y, self.height);
        let (top, bottom) = (y0 * self.width, y1 * self.width);
        std::array::from_fn(|c| {
            let a = self.pixels[top + x0][c] + (self.pixels[top + x1][c] - self.pixels[top + x0][c]) * fx;
            let b = self.pixels[bottom + x0][c]
                + (self.pixels[bottom + x1][c] - self.pixels[bottom + x0][c]) * fx;
            a + (b - a) * fy
        })
    }
}
