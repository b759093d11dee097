//! Drawing into RGB images, for plots and debug images: a [`Canvas`] with lines, marks and text in an
//! embedded [`font`].
//!
//! ```
//! use nalgebra::Vector2;
//! use yamabico_drawing::{Canvas, Color};
//!
//! const RED: Color = [255, 0, 0];
//!
//! let mut pixels = vec![0; 3 * 64 * 48];
//! let mut canvas = Canvas::new(&mut pixels, 64, 48).expect("three bytes per pixel");
//! canvas.line(Vector2::new(0.0, 40.0), Vector2::new(63.0, 40.0), RED);
//! canvas.text(Vector2::new(2.0, 2.0), "heading 3.1", RED);
//! assert_eq!(pixels[3 * 40 * 64..][..3], RED);
//! ```

mod canvas;
pub mod font;
pub mod palette;

pub use canvas::{Canvas, Color};
