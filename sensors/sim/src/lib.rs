//! A simulated world: cameras, sonars, wheel encoders and a drive.
//!
//! [`World`] is what a world file says, [`Scene`] the same built and lit, with its people at one instant, and
//! [`Renderer`] takes pictures of it.

pub mod random;
pub mod render;
pub mod scene;
pub mod world;

pub use render::{CameraView, Photometry, Renderer};
pub use scene::Scene;
pub use world::World;
