//! From free distances all around to the direction to drive in: shared by every way of seeing free floor.
//!
//! A robot that drives cannot turn aside at once: each direction is judged by the way that the robot would really take
//! with its acceleration, and by whether it could still stop soon after. Sekimori, Usui, Masutani & Miyazaki (section 3)
//! drive with the velocity taken into account; how is ours.

pub mod choice;
pub mod free_distances;
pub mod heading;
pub mod limited_motion;

pub use choice::{Before, Choice, ChoiceRules, Chooser, Start, Velocity};
pub use free_distances::FreeDistances;
pub use heading::{Drive, HeadingRules, Rollout};
pub use limited_motion::LimitedMotion;
