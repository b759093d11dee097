//! Computer vision for mobile robots: pure functions over image views and caller-owned workspaces.
//!
//! A workspace (detector, finder, filter) allocates for its first image only. This crate does not depend on behaviors,
//! messages or transport.
//!
//! | Task | Modules |
//! |---|---|
//! | Edges and segments | [`gradient`], [`segments`], [`segment_fit`] |
//! | Corridors | [`vanishing_point`], [`corridor`]: heading, floor lines, wall distances; [`corridor_evidence`]: probability of a corridor, walls ahead |
//! | Mirror cameras | [`radial_edges`], [`azimuth_profile`]: vertical edges by azimuth |
//! | Floors | [`floor_columns`]: where the floor ends; [`floor_appearance`], [`floor_color`], [`floor_sample`], [`floor_training`], [`floor_color_file`] |
//! | Floor or thing from motion | [`plane_motion`] |
//! | Maps | [`map`]: wire frames and their visible edges; [`azimuth_map`]: bearing-only mapping, free space, paths |
//! | Matching | [`azimuth_map::CyclicMatcher`]: tracked to observed edges; [`azimuth_map::relink`]: lost to recovered ones |
//! | Grids around a robot | [`rolling_window`] |
//! | Calibration of cameras | [`calibration`]: lens, mount and clock |
//! | Masks and filters | [`bit_image`], [`morphology`], [`median`] |
//! | Geometry and kernels | [`polygon`], [`vectorize`] |
//!
//! Algorithms that serve a single behavior are in the crate of that behavior.
//!
//! ```
//! use yamabico_geometry::{camera::Intrinsics, image::ImageView};
//! use yamabico_vision::segments::{SegmentConfig, SegmentDetector};
//! use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};
//!
//! // Walls, floor and ceiling of a corridor with the vanishing point (150, 110).
//! let shade = |u: i32, v: i32| match (u - 150, v - 110) {
//!     (du, dv) if dv.abs() > du.abs() => if dv > 0 { 190 } else { 220 },
//!     (du, _) => if du > 0 { 130 } else { 160 },
//! };
//! let pixels: Vec<u8> = (0..320 * 240).map(|i| shade(i % 320, i / 320)).collect();
//! let mut detector = SegmentDetector::new(SegmentConfig::default());
//! let segments = detector.detect(ImageView::new(&pixels, 320, 240, 320)?)?;
//! let camera = Intrinsics::from_horizontal_fov(320, 240, 1.0);
//! let mut finder = VanishingPointFinder::new(VanishingPointConfig::default());
//! let found = finder.find(segments, &camera, None)?;
//! assert!((found.pixel.x - 150.0).abs() < 1.0 && (found.pixel.y - 110.0).abs() < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod azimuth_map;
pub mod azimuth_profile;
pub mod bit_image;
pub mod calibration;
pub mod corridor;
pub mod corridor_evidence;
pub mod floor_appearance;
pub mod floor_color;
pub mod floor_color_file;
pub mod floor_columns;
pub mod floor_sample;
pub mod floor_training;
pub mod gradient;
pub mod map;
pub mod median;
pub mod morphology;
pub mod plane_motion;
pub mod polygon;
pub mod radial_edges;
pub mod rolling_window;
pub mod segment_fit;
pub mod segments;
pub mod vanishing_point;
pub mod vectorize;
