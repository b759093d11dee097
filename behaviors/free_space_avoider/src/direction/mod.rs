//! Choice of a driving direction from free distances, independent of the method that detects free floor.
//!
//! Each direction is judged by the trajectory that the robot can follow from its velocity with limited acceleration,
//! and by its ability to stop afterwards. Sekimori, Usui, Masutani & Miyazaki (section 3) take the velocity into
//! account without details. Differs from \[1\]: the trajectories and the search are our own.

pub mod choice;
pub mod free_distances;
pub mod heading;
pub mod limited_motion;
pub mod trajectories;

pub use choice::{Choice, ChoiceRules, Chooser, PreviousChoice, Start, Velocity};
pub use free_distances::FreeDistances;
pub use heading::{HeadingChoice, HeadingRules, Rollout};
pub use limited_motion::LimitedMotion;
