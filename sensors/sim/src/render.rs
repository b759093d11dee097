//! Rendering of a scene: a polygon rasterizer with exact edges along scan lines, and a ray caster for comparison.

mod cast;
mod meridian;
mod mirror;
mod optics;
mod photometry;
mod project;
mod raster;
mod resolve;
mod ring;
mod shade;
mod spans;
mod tiles;

use rand_pcg::Pcg64;
use thiserror::Error;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;

use crate::Scene;
use optics::Optics;
use photometry::ImageSensor;
use project::PosedPinhole;
use raster::Raster;

pub use cast::RayBundle;
pub use mirror::{MirrorRenderer, MirrorView};
pub use photometry::Photometry;

/// View of a pinhole camera on a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// Focal lengths, principal point and image size.
    pub intrinsics: Intrinsics,
    /// Pose of the camera on the robot.
    pub mount: Mount,
    /// Pose of the robot in the world frame.
    pub robot: Pose2,
}

/// Renderer of one pinhole camera; reuses its buffers and continues its noise from frame to frame.
pub struct Renderer {
    sensor: ImageSensor,
    gray: Eye<1>,
    color: Eye<3>,
}

/// Rasterizer and lens of images with `C` channels.
#[derive(Default)]
struct Eye<const C: usize> {
    raster: Raster<C>,
    optics: Optics<C>,
}

/// Error from rendering an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RenderError {
    /// The buffer has not the size of the image.
    #[error("the buffer must hold {needed} bytes, but holds {given} bytes")]
    BufferSize {
        /// Width times height times channels, bytes.
        needed: usize,
        /// Size of the buffer, bytes.
        given: usize,
    },
    /// Intrinsics, mount or pose are invalid.
    #[error("the intrinsics, the mount or the pose of the camera are invalid or not finite")]
    View,
}

impl Renderer {
    /// Returns a renderer with this photometry, and noise from `rng`, see [`crate::random::stream`].
    #[must_use]
    pub fn new(photometry: Photometry, rng: Pcg64) -> Self {
        Self { sensor: ImageSensor::new(photometry, rng), gray: Eye::default(), color: Eye::default() }
    }

    /// Renders the view in gray levels, width x height bytes.
    ///
    /// # Errors
    /// [`RenderError`] if the buffer has another size or the view is invalid.
    pub fn render(&mut self, scene: &Scene, view: &CameraView, image: &mut [u8]) -> Result<(), RenderError> {
        view.check(image.len(), 1)?;
        self.gray.expose(scene, view, &mut self.sensor, image);
        Ok(())
    }

    /// Renders the view in color, three bytes (red, green, blue) per pixel.
    ///
    /// # Errors
    /// [`RenderError`] if the buffer has another size or the view is invalid.
    pub fn render_rgb(
        &mut self,
        scene: &Scene,
        view: &CameraView,
        image: &mut [u8],
    ) -> Result<(), RenderError> {
        view.check(image.len(), 3)?;
        self.color.expose(scene, view, &mut self.sensor, image);
        Ok(())
    }

    /// Renders the view in gray levels by casting `per_side` x `per_side` rays per pixel: slow, for comparison,
    /// with a perfect lens.
    ///
    /// # Errors
    /// [`RenderError`] if the buffer has another size or the view is invalid.
    pub fn cast(
        &mut self,
        scene: &Scene,
        view: &CameraView,
        per_side: usize,
        image: &mut [u8],
    ) -> Result<(), RenderError> {
        view.check(image.len(), 1)?;
        let posed = PosedPinhole::new(view);
        let k = &view.intrinsics;
        self.sensor.open_shutter();
        let mut row = vec![[0.0; 1]; k.width as usize];
        for y in 0..k.height as usize {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = cast::pixel(scene, &posed, x, y, per_side);
            }
            self.sensor.digitize([k.width, k.height], y, &row, line(image, y, k.width, 1));
        }
        Ok(())
    }
}

impl<const C: usize> Eye<C> {
    fn expose(&mut self, scene: &Scene, view: &CameraView, sensor: &mut ImageSensor, image: &mut [u8]) {
        let size = [view.intrinsics.width, view.intrinsics.height];
        let posed = PosedPinhole::new(view);
        sensor.open_shutter();
        if sensor.photometry.has_perfect_lens() {
            self.raster.draw(scene, &posed, |y, row, _| {
                sensor.digitize(size, y, row, line(image, y, size[0], C));
            });
            return;
        }
        self.optics.begin(size);
        self.raster.draw(scene, &posed, |_, row, _| self.optics.push(row));
        for (y, row) in self.optics.focus(sensor.photometry).enumerate() {
            sensor.digitize(size, y, row, line(image, y, size[0], C));
        }
    }
}

impl CameraView {
    fn check(&self, given: usize, channels: usize) -> Result<(), RenderError> {
        if !(self.intrinsics.is_valid() && self.mount.is_finite() && self.robot.is_finite()) {
            return Err(RenderError::View);
        }
        let needed = self.intrinsics.width as usize * self.intrinsics.height as usize * channels;
        if given == needed { Ok(()) } else { Err(RenderError::BufferSize { needed, given }) }
    }
}

fn line(image: &mut [u8], y: usize, width: u32, channels: usize) -> &mut [u8] {
    let stride = width as usize * channels;
    &mut image[y * stride..(y + 1) * stride]
}
