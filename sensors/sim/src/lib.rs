//! A simulated world: cameras, sonars, wheel encoders and a drive.
//!
//! [`World`] is what a world file says, [`Scene`] the same built and lit, with its people at one instant, and
//! [`Renderer`] takes pictures of it. [`Simulation`](simulation::Simulation) moves a [`Body`](body::Body) among solids
//! and people, and [`driver`] offers all of it as a device like any other.

pub mod body;
pub mod clearance;
pub mod device;
pub mod encoder;
pub mod random;
pub mod render;
pub mod scene;
pub mod simulation;
pub mod sonar;
pub mod world;

pub use device::driver;
pub use render::{CameraView, MirrorRenderer, MirrorView, Photometry, Renderer};
pub use scene::Scene;
pub use world::World;
