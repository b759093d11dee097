//! Loading of images, and output of images with overlays.

use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, Rgb, RgbImage};
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::overlay::Overlay;
use yamabico_drawing::Canvas;
use yamabico_runtime::overlay_painter::with_overlays;

/// Distance between the levels of an image with an overlay.
const POSTERIZED: u8 = 17;

/// Folder that images are written to, if any.
pub struct Output(Option<PathBuf>);

impl Output {
    /// Creates the folder.
    pub fn new(folder: Option<PathBuf>) -> Result<Self, String> {
        if let Some(folder) = &folder {
            std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        }
        Ok(Self(folder))
    }

    /// Returns true if images are written.
    pub fn is_on(&self) -> bool {
        self.0.is_some()
    }

    /// Writes an RGB image as `NAME.png`.
    pub fn rgb(&self, name: &str, pixels: &[u8], width: u32, height: u32) -> Result<(), String> {
        self.write(name, pixels, width, height, ExtendedColorType::Rgb8)
    }

    /// Writes a gray image as `NAME.png`.
    pub fn gray(&self, name: &str, pixels: &[u8], width: u32, height: u32) -> Result<(), String> {
        self.write(name, pixels, width, height, ExtendedColorType::L8)
    }

    /// Moves an image that was written elsewhere to `NAME.png`, or removes it.
    pub fn keep(&self, name: &str, file: &Path) -> Result<(), String> {
        let failed = |error: std::io::Error| format!("{}: {error}", file.display());
        if let Some(folder) = &self.0 {
            std::fs::copy(file, folder.join(format!("{name}.png"))).map_err(failed)?;
        }
        std::fs::remove_file(file).map_err(failed)
    }

    /// Writes a gray image as `NAME.png`, in color, with what `draw` draws on it.
    pub fn overlay(
        &self,
        name: &str,
        image: ImageView,
        draw: impl FnOnce(&mut Canvas),
    ) -> Result<(), String> {
        if !self.is_on() {
            return Ok(());
        }
        let (width, height) = (image.width(), image.height());
        let mut pixels = vec![0; 3 * width * height];
        let mut canvas = Canvas::new(&mut pixels, width, height).ok_or("an image without pixels")?;
        canvas.copy_gray(image);
        draw(&mut canvas);
        self.rgb(name, &pixels, width as u32, height as u32)
    }

    /// Writes a gray image with the layers of an overlay, if a behavior drew one.
    pub fn layers(&self, name: &str, image: ImageView, overlay: Option<&Overlay>) -> Result<(), String> {
        let pixel = |u: u32, v: u32| Rgb([image.row(v as usize)[u as usize]; 3]);
        let picture = RgbImage::from_fn(image.width() as u32, image.height() as u32, pixel);
        self.rgb_layers(name, picture, overlay)
    }

    /// Same as [`Output::layers`], for an image in color.
    pub fn rgb_layers(
        &self,
        name: &str,
        mut picture: RgbImage,
        overlay: Option<&Overlay>,
    ) -> Result<(), String> {
        let marks = overlay.map_or(&[][..], Overlay::marks);
        posterize(&mut picture, POSTERIZED);
        let drawn = with_overlays(&picture, &[marks], &|_| true);
        self.rgb(name, &drawn, drawn.width(), drawn.height())
    }

    fn write(
        &self,
        name: &str,
        pixels: &[u8],
        width: u32,
        height: u32,
        color: ExtendedColorType,
    ) -> Result<(), String> {
        let Some(folder) = &self.0 else { return Ok(()) };
        let path = folder.join(format!("{name}.png"));
        let problem = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let file = std::fs::File::create(&path).map_err(|error| problem(&error))?;
        PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::Adaptive)
            .write_image(pixels, width, height, color)
            .map_err(|error| problem(&error))
    }
}

/// Loads an image in color.
pub fn load_rgb(path: &Path) -> Result<RgbImage, String> {
    Ok(image::open(path).map_err(|error| format!("{}: {error}", path.display()))?.to_rgb8())
}

/// Loads an image in gray.
pub fn load_gray(path: &Path) -> Result<GrayImage, String> {
    let rgb = load_rgb(path)?;
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    let mut gray = GrayImage::default();
    gray.copy_from_rgb8(rgb.as_raw(), width, height, 3 * width)
        .map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(gray)
}

/// Returns a view of gray pixels without padding.
pub fn view(pixels: &[u8], width: u32, height: u32) -> Result<ImageView<'_>, String> {
    let width = width as usize;
    ImageView::new(pixels, width, height as usize, width).map_err(|error| error.to_string())
}

/// Reduces the number of levels, for small files.
fn posterize(pixels: &mut [u8], step: u8) {
    pixels.iter_mut().for_each(|level| *level = *level / step * step);
}
