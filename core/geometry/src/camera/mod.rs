//! Camera models: the ray of a pixel, and the pixel of a point.
//!
//! The optical frame of a pinhole camera is x right, y down, z forward. In the image, u grows to the right and v
//! downward; pixel centers lie on integers, so the center of a W x H image is ((W - 1)/2, (H - 1)/2).
//!
//! An omnidirectional camera looks up at a mirror ([`mirror_camera`]); its frame is that of the body, with z along the
//! mirror's axis.

mod calibration;
pub mod conic_mirror;
mod distortion;
pub mod hyperboloidal_mirror;
mod intrinsics;
pub mod mirror_camera;
pub mod mirror_image;
pub mod mount;
pub mod pinhole;
pub mod radial_model;

pub use calibration::Calibration;
pub use conic_mirror::ConicMirror;
pub use distortion::Distortion;
pub use hyperboloidal_mirror::{FloorFormula, HyperboloidalMirror};
pub use intrinsics::{Intrinsics, IntrinsicsConfig};
pub use mirror_camera::{
    Meridian, Mirror, MirrorCamera, MirrorConfig, MirrorError, MirrorProjectionError, MirrorRay,
};
pub use mirror_image::{MirrorImage, MirrorImageConfig};
pub use mount::{Mount, MountConfig};
pub use pinhole::{NEAR_PLANE_M, Pinhole, ProjectionError, clip_to_near_plane};
pub use radial_model::{RadialModel, RadialProfile};

/// Returns true if the pixel lies in an image of this width and height: within [-0.5, width - 0.5) and [-0.5, height - 0.5).
fn is_in_image(pixel: nalgebra::Vector2<f64>, [width, height]: [u32; 2]) -> bool {
    pixel.x >= -0.5
        && pixel.y >= -0.5
        && pixel.x < f64::from(width) - 0.5
        && pixel.y < f64::from(height) - 0.5
}
