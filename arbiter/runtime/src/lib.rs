//! Runs a robot: execution, supervision, recording, reports, and the client of a running robot.
//!
//! | module | contents |
//! |---|---|
//! | [`run`](mod@run) | a whole run: opens a task, runs it to its end, records and summarizes it |
//! | [`execution`] | the plan of a run, lockstep and live execution, the manifest of a live robot |
//! | [`deadlines`] | measured durations of the plugins' calls, and deadlines that suit the machine |
//! | [`supervisor`] | plugins in processes of their own: started, watched and restarted |
//! | [`record`] | taps on the messages of a run: digest, MCAP recording, playback |
//! | [`replay`] | a recorded run again: compared to the byte, or changed |
//! | [`overlay_painter`] | what behaviors drew, on the pictures in which they saw it |
//! | [`report`] | the summary of a run and the plot of its trajectory |
//! | [`client`] | the client of a running robot, for every live command |
//!
//! ```
//! use yamabico_core::message::{MessageType, Odometry};
//! use yamabico_core::time::Time;
//! use yamabico_runtime::record::{Digest, Tap};
//!
//! // Every run hashes its messages in order: equal runs have equal digests.
//! let digest = |x: f64| {
//!     let mut digest = Digest::new();
//!     let odometry = Odometry { x, ..Default::default() };
//!     digest.message("sensors/wheels", &MessageType::of::<Odometry>(), Time::ZERO, bytemuck::bytes_of(&odometry), &[]);
//!     digest.hex()
//! };
//! assert_eq!(digest(1.0), digest(1.0));
//! assert_ne!(digest(1.0), digest(2.0));
//! ```

pub mod client;
pub mod deadlines;
pub mod execution;
pub mod overlay_painter;
pub mod record;
pub mod replay;
pub mod report;
pub mod run;
pub mod supervisor;
