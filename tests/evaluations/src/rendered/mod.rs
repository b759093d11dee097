//! Sweeps over rendered images.

pub mod approaches;
pub mod corridor_views;
pub mod passages;
pub mod pose_fixes;
