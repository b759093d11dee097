//! Localization by the azimuths of vertical edges in the images of a mirror camera.
//!
//! Yagi, Nishizawa & Yachida (1995) \[1\], section VI. Differs from \[1\]: observed edges and map edges are paired by
//! joint compatibility, and the pose is the maximum-likelihood estimate from azimuths and odometry. The search over the
//! heading of \[1\] is available as [`PanSearch`] for comparison.

mod bearing;
mod chi_square;
mod finder;
mod joint_compatibility;
mod localizer;
pub mod overlay;
mod pan_search;
mod solver;

pub use bearing::{BearingPrediction, EdgeLandmark, LeverArm, SeenBearing, predict};
pub use chi_square::quantile;
pub use finder::AzimuthFinder;
pub use joint_compatibility::{JointCompatibility, JointRule, Pairing};
pub use localizer::{AzimuthFix, AzimuthLocalizer, AzimuthProblem, AzimuthRule, Obstruction};
pub use pan_search::{PanError, PanFix, PanSearch};
pub use solver::{BearingPair, Loss, Solution, SolverError, SolverRule, filter, most_likely_pose};
