//! Simulated world: cameras, sonars, wheel encoders and a drive.
//!
//! A [`World`] is the content of a world file, a [`Scene`] the same world with its surfaces, its light and its people at one
//! time, and [`Renderer`] and [`MirrorRenderer`] render images of it. A [`Simulation`](simulation::Simulation) moves a
//! [`Body`](body::Body) among solids and people. [`driver`] returns the device driver `sim` for robot files.
//!
//! ```
//! use yamabico_core::camera::{Intrinsics, Mount};
//! use yamabico_core::geometry::Pose2;
//! use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World, random};
//!
//! let scene = Scene::new(&World::corridor(10.0, 2.0), 1)?;
//! let intrinsics = Intrinsics::from_horizontal_fov(64, 48, 1.0);
//! let view = CameraView { intrinsics, mount: Mount::level(0.6), robot: Pose2::IDENTITY };
//! let mut image = vec![0; 64 * 48];
//! Renderer::new(Photometry::default(), random::stream(1, "camera")).render(&scene, &view, &mut image)?;
//! assert!(image.iter().any(|&gray| gray > 100));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod body;
pub mod building;
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
