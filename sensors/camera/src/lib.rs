//! Cameras: image sequences from files.
