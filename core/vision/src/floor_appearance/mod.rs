//! Floor by its learned look: a second opinion beside geometry, without thresholds set by hand.
//!
//! An image is divided into blocks. Each block has a [`Feature`]: chromaticity, brightness and texture. The floor's look is up to four
//! Gaussian [`Modes`], learned from what was driven over, or, before that, from the foreground directly in front of the
//! robot; the look of everything else is learned from above the horizon. The likelihood ratio of both, where the floor may be
//! ([`FloorPlace`]), and the boundaries between neighboring blocks give the log odds of floor by a random walk with
//! restarts: a block belongs to what it is connected with, and edges that are stronger than the floor's own texture
//! disconnect. While nothing was learned, the foreground is doubted if it shows two surfaces. What crosses the horizon as a plumb
//! edge is taller than the camera, and no floor ([`PlumbEdges`]). The result is blended with that of a second model, in which each
//! column of blocks is floor from the bottom up to one end ([`FloorEnds`]).
//!
//! Blocks whose pixels saturate (lamps, windows, and their mirror images in a polished floor) have no likelihood; their
//! place and their neighbors decide. Where walls look like the floor, the ratio is uninformative, and only the near floor up to
//! the first boundary is found. Gray images have no chromaticity; their ratio has half the weight.
//!
//! ```
//! use yamabico_geometry::image::RgbView;
//! use yamabico_vision::floor_appearance::{FloorAppearance, FloorPlace, Picture, Vote};
//!
//! // A gray floor below a blue wall, with a yellow box on the left.
//! let color_at = |u: usize, v: usize| match (u, v) {
//!     (20..90, 90..170) => [200, 180, 40],
//!     (_, 0..120) => [60, 70, 120],
//!     _ => [130, 128, 120],
//! };
//! let data: Vec<u8> = (0..240 * 240).flat_map(|i| color_at(i % 240, i / 240)).collect();
//! let image = RgbView::new(&data, 240, 240, 3 * 240)?;
//! let mut appearance = FloorAppearance::default();
//! let votes = appearance.observe(Picture::Color(image), &FloorPlace::UNKNOWN_CAMERA)?;
//! assert_eq!([(120, 200), (200, 140), (50, 140), (120, 60)].map(|(u, v)| votes.at_pixel(u, v)), [
//!     Vote::Floor,
//!     Vote::Floor,
//!     Vote::Other,
//!     Vote::Other
//! ]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Modes and their update follow Dahlkamp, Kaehler, Stavens, Thrun & Bradski (2006); the random walk follows Grady (2006).

pub mod boundaries;
pub mod features;
pub mod file;
pub mod floor_ends;
pub mod floor_samples;
pub mod learned;
pub mod modes;
pub mod observer;
mod one_surface;
pub mod place;
pub mod plumb_edges;
pub mod random_walk;
pub mod votes;

pub use features::{Blocks, Feature, Picture};
pub use file::{AppearanceFile, FLOOR_APPEARANCE_FILE};
pub use floor_ends::FloorEnds;
pub use floor_samples::FloorSamples;
pub use learned::LearnedLook;
pub use modes::{Mode, Modes};
pub use observer::{AppearanceError, FloorAppearance};
pub use place::FloorPlace;
pub use plumb_edges::PlumbEdges;
pub use votes::{FloorVotes, Vote};
