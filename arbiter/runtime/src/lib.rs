//! Runs a robot: execution, supervision, recording, reports, and the client of a running robot.
//!
//! | module | contents |
//! |---|---|
//! | [`run`](mod@run) | a whole run: opens a task, runs it to its end, records and summarizes it |
//! | [`execution`] | the plan of a run, lockstep and live execution, the manifest of a live robot |
//! | [`supervisor`] | plugins in processes of their own: started, watched and restarted |
//! | [`record`] | taps on the messages of a run: digest, MCAP recording, playback |
//! | [`report`] | the summary of a run and the plot of its trajectory |
//! | [`client`] | the client of a running robot, for every live command |

pub mod client;
pub mod execution;
pub mod record;
pub mod report;
pub mod run;
pub mod supervisor;
