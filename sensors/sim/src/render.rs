//! Pictures of a scene: polygons with exact edges along each line, and a ray caster for everything else.

mod cast;
mod meridian;
mod mirror;
mod photometry;
mod project;
mod raster;
mod resolve;
mod ring;
mod shade;
mod spans;

use rand_pcg::Pcg64;
use thiserror::Error;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;

use crate::Scene;
use photometry::Film;
use project::Eye;
use raster::Raster;

pub use cast::RayBundle;
pub use mirror::{MirrorRenderer, MirrorView};
pub use photometry::Photometry;

/// A pinhole camera on a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// Focal lengths, principal point and size of the picture.
    pub intrinsics: Intrinsics,
    /// Where the camera is on the robot.
    pub mount: Mount,
    /// Where the robot is in the world.
    pub robot: Pose2,
}

/// Takes pictures with one camera; keeps its buffers and its noise from picture to picture.
pub struct Renderer {
    film: Film,
    gray: Raster<1>,
    color: Raster<3>,
}

/// The picture cannot be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RenderError {
    /// The buffer does not have the size that the camera's picture needs.
    #[error("the picture needs {needed} bytes, the buffer has {given}")]
    BufferSize {
        /// Width times height times channels.
        needed: usize,
        /// The buffer's length.
        given: usize,
    },
    /// Intrinsics, mount or pose are not usable numbers.
    #[error("the camera's intrinsics, mount or pose are not usable")]
    View,
}

impl Renderer {
    /// A camera with this lens and sensor, whose noise comes from `rng` (see [`crate::random::stream`]).
    #[must_use]
    pub fn new(photometry: Photometry, rng: Pcg64) -> Self {
        Self { film: Film::new(photometry, rng), gray: Raster::default(), color: Raster::default() }
    }

    /// Draws the view as gray levels, row by row, width x height bytes.
    ///
    /// # Errors
    /// [`RenderError`] when the buffer or the view do not fit.
    pub fn render(&mut self, scene: &Scene, view: &CameraView, image: &mut [u8]) -> Result<(), RenderError> {
        view.check(image.len(), 1)?;
        self.gray.draw(scene, &Eye::new(view), |y, row, k| {
            self.film.develop([k.width, k.height], y, row, line(image, y, k.width, 1));
        });
        Ok(())
    }

    /// Draws the view in color, three bytes (red, green, blue) a pixel.
    ///
    /// # Errors
    /// [`RenderError`] when the buffer or the view do not fit.
    pub fn render_rgb(
        &mut self,
        scene: &Scene,
        view: &CameraView,
        image: &mut [u8],
    ) -> Result<(), RenderError> {
        view.check(image.len(), 3)?;
        self.color.draw(scene, &Eye::new(view), |y, row, k| {
            self.film.develop([k.width, k.height], y, row, line(image, y, k.width, 3));
        });
        Ok(())
    }

    /// Draws the view as gray levels by casting `per_side` x `per_side` rays a pixel: slow, for comparison.
    ///
    /// # Errors
    /// [`RenderError`] when the buffer or the view do not fit.
    pub fn cast(
        &mut self,
        scene: &Scene,
        view: &CameraView,
        per_side: usize,
        image: &mut [u8],
    ) -> Result<(), RenderError> {
        view.check(image.len(), 1)?;
        let eye = Eye::new(view);
        let k = &view.intrinsics;
        let mut row = vec![[0.0; 1]; k.width as usize];
        for y in 0..k.height as usize {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = cast::pixel(scene, &eye, x, y, per_side);
            }
            self.film.develop([k.width, k.height], y, &row, line(image, y, k.width, 1));
        }
        Ok(())
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
