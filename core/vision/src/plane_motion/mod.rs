//! Floor or thing, from two looks: geometry that does not depend on what a building looks like.
//!
//! With odometry, two pictures of the floor determine each other by a homography. Points that move as it says are
//! floor, points that move less are mirror images below it, points that move more are things above it, and points that
//! fit no rigid motion move by themselves. Obstacles from deviation from the floor's motion: Enkelmann (1991);
//! Santos-Victor & Sandini (1996).
//!
//! | Step | Module |
//! |---|---|
//! | Warp of the floor between two pictures, with derivatives | [`floor_view`] |
//! | Correction of motion and mount, from features | [`motion_prior`], [`sparse_alignment`] |
//! | Height of a point and its covariance | [`parallax`], [`point_height`] |
//! | Correction of motion and mount, from pictures | [`band_pass`], [`look_history`], [`direct_alignment`] |
//! | Delay of the wheels | [`wheel_lag`] |
//! | Search along parallax lines | [`gradient_points`], [`quad_image`], [`parallax_search`], [`motion_point`] |
//! | Judged points of each picture | [`PictureJudge`] |
//! | Decision over time | [`sequential_test`], [`log_odds`], [`evidence_grid`] |
//! | Things and walkers | [`grid_obstacles`], [`movers`] |
//! | Judge, grid and walkers together | [`PlaneMotion`] |
//!
//! A grid of its own takes [`PictureJudge::judge`]: each [`motion_point::MotionPoint`] has its class, its log odds
//! ([`motion_point::MotionPoint::advantage`]), its floor point and foot in the robot frame at the capture, and its height,
//! with deviations. [`PictureJudge::pose`] places that frame in the odometry frame. [`movers::MoverTracker::update`] takes
//! the same points. A grid sums evidence by place; [`sequential_test::SequentialTest`] sums it by feature, for those who
//! follow features from picture to picture instead.

pub mod band_pass;
mod candidate_sweep;
pub mod detector;
pub mod direct_alignment;
pub mod evidence_grid;
pub mod floor_view;
pub mod gradient_points;
pub mod grid_obstacles;
pub mod log_odds;
pub mod look_history;
pub mod motion_point;
pub mod motion_prior;
pub mod movers;
pub mod parallax;
pub mod parallax_search;
mod patch;
mod patch_projection;
pub mod picture_judge;
pub mod point_height;
pub mod quad_image;
pub mod sequential_test;
pub mod sparse_alignment;
pub mod wheel_lag;

pub use detector::PlaneMotion;
pub use picture_judge::{NotJudged, PictureJudge};
