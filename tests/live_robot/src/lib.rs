//! A robot that runs live in processes of its own: observed from outside, and damaged on purpose.
//!
//! - [`robot`]: starts `yamabico run --live` and observes heartbeats, commands, ground truth and system resources.
//! - [`campaign`]: kills and hangs processes at random times.
//! - [`laggard`]: a behavior that computes for long, and hangs on request.
//! - [`load`]: busy loops beside the robot.
//! - [`python_failures`]: a behavior in Python that fails on request.
//! - [`venv`]: a Python environment with the package of this repository.

#![allow(clippy::expect_used, clippy::unwrap_used, reason = "a rig stops a test at the first surprise")]

pub mod campaign;
pub mod laggard;
pub mod load;
pub mod python_failures;
pub mod robot;
pub mod venv;
