//! What cameras see: one textbook noun a module. Pure functions over image views and caller-owned workspaces; nothing
//! allocates once a workspace has seen its first frame.

pub mod area_average;
pub mod azimuth_map;
pub mod azimuth_profile;
pub mod bit_image;
pub mod corridor;
pub mod dark_cells;
pub mod floor_color;
pub mod floor_color_file;
pub mod floor_sample;
pub mod floor_training;
pub mod gradient;
pub mod isodata;
pub mod level_edges;
pub mod map;
pub mod median;
pub mod morphology;
pub mod polygon;
pub mod radial_edges;
pub mod regions;
pub mod ring_cells;
pub mod segment_fit;
pub mod segments;
pub mod template;
pub mod vanishing_point;
mod vectorize;
pub mod vertical_edges;
