//! Renderer of omnidirectional cameras with a mirror.
//!
//! The ring of the mirror is rendered unrolled, see [`super::ring`], with more samples than the image has near its center. A
//! lookup table resamples it to the image. Light, texture, people and reflections are the same as for a pinhole camera.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector2, Vector3};
use rand_pcg::Pcg64;
use yamabico_core::camera::{Meridian, MirrorCamera, Mount};
use yamabico_core::geometry::Pose2;

use super::cast::RayBundle;
use super::meridian::PosedMirror;
use super::photometry::ImageSensor;
use super::ring::{Ring, RingRenderer};
use super::{Photometry, RenderError, line};
use crate::Scene;

/// Width of a row at the outer end of a ring, pixels.
const ROW_PX: f64 = 1.0;
/// Minimum inner radius of a ring, pixels; the innermost ring extends to the center.
const MIN_RING_PX: f64 = 16.0;
/// Radiance outside the mirror.
const BLACK: f32 = 0.0;

/// View of a mirror camera on a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorView {
    /// Pose of the camera on the robot.
    pub mount: Mount,
    /// Pose of the robot in the world frame.
    pub robot: Pose2,
}

/// Renderer of one mirror camera; reuses its tables and buffers, and continues its noise from frame to frame.
pub struct MirrorRenderer {
    camera: MirrorCamera,
    sensor: ImageSensor,
    rings: Vec<Ring>,
    /// Position of each pixel in the unrolled rings.
    taps: Vec<Tap>,
    gray: Layer<1>,
    color: Layer<3>,
}

#[derive(Default)]
struct Layer<const C: usize> {
    renderer: RingRenderer<C>,
    rings: Vec<[f32; C]>,
    row: Vec<[f32; C]>,
}

/// Area of a pixel in the unrolled rings: three rows and two columns with their weights.
#[derive(Clone, Copy, Debug)]
struct Tap {
    /// Index of the left column in the first row; [`Tap::NONE`] outside the mirror.
    first: u32,
    /// Distance between rows.
    stride: u32,
    /// Weights of the rows.
    rows: [f32; 3],
    /// Weight of the second column.
    right: f32,
}

impl Tap {
    const NONE: u32 = u32::MAX;
    const OUTSIDE: Self = Self { first: Self::NONE, stride: 0, rows: [0.0; 3], right: 0.0 };
}

/// Number of rows after the last row of a ring that repeat its first, so that the rows of every pixel are contiguous.
const REPEATED: usize = 2;

impl MirrorRenderer {
    /// Returns a renderer of this camera, with noise from `rng`, see [`crate::random::stream`].
    #[must_use]
    pub fn new(camera: MirrorCamera, photometry: Photometry, rng: Pcg64) -> Self {
        let rings = rings(&camera);
        let taps = taps(&camera, &rings);
        let sensor = ImageSensor::new(photometry, rng);
        Self { camera, sensor, rings, taps, gray: Layer::default(), color: Layer::default() }
    }

    /// Returns the camera model.
    #[must_use]
    pub fn camera(&self) -> &MirrorCamera {
        &self.camera
    }

    /// Renders the view in gray levels, width x height bytes; black outside the mirror.
    ///
    /// # Errors
    /// [`RenderError`] if the buffer has another size or the view is invalid.
    pub fn render(&mut self, scene: &Scene, view: &MirrorView, image: &mut [u8]) -> Result<(), RenderError> {
        self.check(view, image.len(), 1)?;
        let posed = self.posed(view);
        let size = self.size();
        self.sensor.open_shutter();
        self.gray.draw(scene, &posed, &self.rings, &self.taps, size, |y, row| {
            self.sensor.digitize(size, y, row, line(image, y, size[0], 1));
        });
        Ok(())
    }

    /// Renders the view in color, three bytes (red, green, blue) per pixel; black outside the mirror.
    ///
    /// # Errors
    /// [`RenderError`] if the buffer has another size or the view is invalid.
    pub fn render_rgb(
        &mut self,
        scene: &Scene,
        view: &MirrorView,
        image: &mut [u8],
    ) -> Result<(), RenderError> {
        self.check(view, image.len(), 3)?;
        let posed = self.posed(view);
        let size = self.size();
        self.sensor.open_shutter();
        self.color.draw(scene, &posed, &self.rings, &self.taps, size, |y, row| {
            self.sensor.digitize(size, y, row, line(image, y, size[0], 3));
        });
        Ok(())
    }

    /// Renders the view in gray levels by casting `per_side` x `per_side` rays per pixel: slow, for comparison.
    ///
    /// # Errors
    /// [`RenderError`] if the buffer has another size or the view is invalid.
    pub fn cast(
        &mut self,
        scene: &Scene,
        view: &MirrorView,
        per_side: usize,
        image: &mut [u8],
    ) -> Result<(), RenderError> {
        self.check(view, image.len(), 1)?;
        let posed = self.posed(view);
        let size = self.size();
        self.sensor.open_shutter();
        let mut row = vec![[BLACK; 1]; size[0] as usize];
        for y in 0..size[1] as usize {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = self.cast_pixel(scene, &posed, Vector2::new(x as f64, y as f64), per_side);
            }
            self.sensor.digitize(size, y, &row, line(image, y, size[0], 1));
        }
        Ok(())
    }

    fn cast_pixel(
        &self,
        scene: &Scene,
        posed: &PosedMirror,
        pixel: Vector2<f64>,
        per_side: usize,
    ) -> [f32; 1] {
        let step = 1.0 / per_side as f64;
        let world_from_mirror = posed.mirror_from_world.transpose();
        let mut sum = 0.0;
        for i in 0..per_side * per_side {
            let part = |i: usize| (i as f64 + 0.5) * step - 0.5;
            let at = pixel + Vector2::new(part(i % per_side), part(i / per_side));
            let Some(ray) = self.camera.ray_from_pixel(at) else {
                sum += BLACK;
                continue;
            };
            let beside = |by: Vector2<f64>| {
                let neighbor = self.camera.ray_from_pixel(at + by * step);
                world_from_mirror * neighbor.map_or(ray.direction, |ray| ray.direction)
            };
            let directions = [Vector2::zeros(), Vector2::x(), Vector2::y()].map(beside);
            let origin = posed.at + world_from_mirror * ray.origin.coords;
            sum += RayBundle { origin, directions }.radiance::<1>(scene)[0];
        }
        [sum / (per_side * per_side) as f32]
    }

    fn size(&self) -> [u32; 2] {
        [self.camera.image().width, self.camera.image().height]
    }

    fn check(&self, view: &MirrorView, given: usize, channels: usize) -> Result<(), RenderError> {
        if !(view.mount.is_finite() && view.robot.is_finite()) {
            return Err(RenderError::View);
        }
        let needed = self.taps.len() * channels;
        if given == needed { Ok(()) } else { Err(RenderError::BufferSize { needed, given }) }
    }

    fn posed(&self, view: &MirrorView) -> PosedMirror {
        let (sin, cos) = view.robot.theta.sin_cos();
        let world_from_body = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        let world_from_mirror = world_from_body * view.mount.rotation_body_from_mirror();
        let on_floor = Vector3::new(view.robot.x, view.robot.y, 0.0);
        PosedMirror {
            at: on_floor + world_from_body * view.mount.position_in_body(),
            mirror_from_world: world_from_mirror.transpose(),
            viewpoint: self.camera.mirror().viewpoint(),
        }
    }
}

impl<const C: usize> Layer<C> {
    fn draw(
        &mut self,
        scene: &Scene,
        posed: &PosedMirror,
        rings: &[Ring],
        taps: &[Tap],
        size: [u32; 2],
        mut take: impl FnMut(usize, &[[f32; C]]),
    ) {
        self.rings.resize(rings.iter().map(stored).sum(), [0.0; C]);
        self.renderer.update(scene, posed);
        let mut rest = self.rings.as_mut_slice();
        for ring in rings {
            let (pixels, others) = rest.split_at_mut(stored(ring));
            self.renderer.draw(scene, posed.viewpoint, ring, pixels);
            pixels.copy_within(..REPEATED * ring.grid.width, ring.grid.rows * ring.grid.width);
            rest = others;
        }
        let width = size[0] as usize;
        self.row.resize(width, [BLACK; C]);
        for (y, taps) in taps.chunks_exact(width).enumerate() {
            for (pixel, tap) in self.row.iter_mut().zip(taps) {
                *pixel = if tap.first == Tap::NONE { [BLACK; C] } else { blend(&self.rings, tap) };
            }
            take(y, &self.row);
        }
    }
}

#[inline]
fn blend<const C: usize>(rings: &[[f32; C]], tap: &Tap) -> [f32; C] {
    let mut sum = [0.0; C];
    for (i, share) in tap.rows.iter().enumerate() {
        let at = (tap.first + i as u32 * tap.stride) as usize;
        let (left, right) = (&rings[at], &rings[at + 1]);
        (0..C).for_each(|c| sum[c] += share * (left[c] + (right[c] - left[c]) * tap.right));
    }
    sum
}

fn stored(ring: &Ring) -> usize {
    (ring.grid.rows + REPEATED) * ring.grid.width
}

/// Returns the rings from the rim inward, each with half the radius and half the rows of the one around it.
fn rings(camera: &MirrorCamera) -> Vec<Ring> {
    let image = camera.image();
    let (blind_px, rim_px) = (image.blind_radius_px().floor(), image.rim_radius_px());
    let mut rings = Vec::new();
    let mut outer_px = rim_px.ceil();
    loop {
        let half = (0.5 * outer_px).floor();
        let inner_px = if half < blind_px.max(MIN_RING_PX) { blind_px } else { half };
        // One additional column on either side, for interpolation.
        let (first_px, end_px) = ((inner_px - 1.0).max(0.0), outer_px + 1.0);
        let rows = (TAU * outer_px / ROW_PX).ceil() as usize;
        rings.push(Ring::new(camera.mirror(), rows, first_px, (end_px - first_px) as usize, rim_px));
        if inner_px == blind_px {
            return rings;
        }
        outer_px = inner_px;
    }
}

fn taps(camera: &MirrorCamera, rings: &[Ring]) -> Vec<Tap> {
    let image = camera.image();
    let mut bases = vec![0];
    for ring in rings {
        bases.push(bases[bases.len() - 1] + stored(ring));
    }
    let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| [x, y]));
    let tap = |[x, y]: [u32; 2]| {
        let point = image.mirror_from_pixel(Vector2::new(f64::from(x), f64::from(y)));
        let radius_px = point.norm();
        if !image.is_in_ring(radius_px) {
            return Tap::OUTSIDE;
        }
        // The innermost ring that contains the pixel and its neighbors.
        let inside = |ring: &Ring| ring.grid.first_px + ring.grid.width as f64 - 1.0 >= radius_px;
        let index = rings.iter().rposition(inside).unwrap_or(0);
        let grid = &rings[index].grid;
        let column = (radius_px - grid.first_px - 0.5).clamp(0.0, grid.width as f64 - 1.001);
        // A pixel covers one to two rows: the weights are the covered fractions of the rows.
        let turn = point.y.atan2(point.x).rem_euclid(TAU) / TAU;
        let width = (grid.rows as f64 / (TAU * radius_px.max(0.5))).clamp(1.0, 2.0);
        let low = turn * grid.rows as f64 - 0.5 * width;
        let (first, left) = (low.floor(), column.floor());
        let share = |i: f64| (low + width).min(first + i + 1.0) - low.max(first + i);
        let start = (first as i64).rem_euclid(grid.rows as i64) as usize * grid.width;
        Tap {
            first: (bases[index] + start + left as usize) as u32,
            stride: grid.width as u32,
            rows: [0.0, 1.0, 2.0].map(|i| (share(i).max(0.0) / width) as f32),
            right: (column - left) as f32,
        }
    };
    pixels.map(tap).collect()
}
