//! Cameras: a ray from a pixel, a pixel from a point.
//!
//! The optical frame is x right, y down, z forward. In the image u grows to the right and v downwards; pixel centres
//! lie on integers, so the centre of a W x H image is ((W - 1)/2, (H - 1)/2).

pub mod mount;
pub mod pinhole;

pub use mount::{Mount, MountConfig};
pub use pinhole::{
    Distortion, Intrinsics, IntrinsicsConfig, NEAR_PLANE_M, Pinhole, ProjectionError, clip_to_near_plane,
};
