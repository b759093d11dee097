//! The robot's pose from the azimuths of vertical edges.
//!
//! Yagi, Nishizawa & Yachida (1995), section VI. Differs from \[1\]: edges seen and edges of the map are paired by joint
//! compatibility, and the pose is the most likely one under the azimuths and the odometry together. The paper's search over
//! the heading is kept as [`PanSearch`] to compare with.

mod bearing;
mod chi_square;
mod finder;
mod joint_compatibility;
mod localizer;
mod pan_search;
mod solver;

pub use bearing::{BearingPrediction, EdgeLandmark, LeverArm, SeenBearing, predict};
pub use chi_square::quantile;
pub use finder::AzimuthFinder;
pub use joint_compatibility::{JointCompatibility, JointRule, Pairing};
pub use localizer::{AzimuthFix, AzimuthLocalizer, AzimuthProblem, AzimuthRule, Obstruction};
pub use pan_search::{PanError, PanFix, PanSearch};
pub use solver::{BearingPair, Loss, Solution, SolverError, SolverRule, filter, most_likely_pose};
