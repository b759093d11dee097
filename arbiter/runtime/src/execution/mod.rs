//! Execution of a run: in lockstep with simulated or recorded time, or live.
//!
//! [`Plan`] turns a checked task into topics, devices, behaviors and a policy. [`Lockstep`] or [`Live`] opens the plan and runs
//! it; [`crate::run`] does all of that with recording and summary.

mod arbiter_core;
mod arbiter_host;
mod driver_clock;
mod external_program;
mod goal_monitor;
mod hosted_behavior;
mod hosts;
mod live;
mod lockstep;
mod parameter_server;
mod plan;
mod plugin_stats;
mod robot_manifest;
mod run_end;
mod run_flags;
mod run_stats;
mod separate_processes;
mod service_manager;
mod worker_pool;

pub(crate) use arbiter_core::ArbiterCore;
pub(crate) use hosted_behavior::{HostedBehavior, Hosting};
pub use live::Live;
pub(crate) use lockstep::Life;
pub use lockstep::{Lockstep, SensorSupply};
pub(crate) use plan::sensors;
pub use plan::{Overlays, Plan, Topic};
pub use robot_manifest::{BehaviorEntry, ParameterEntry, PluginEntry, RobotManifest, TopicEntry};
pub(crate) use run_end::run_lockstep;
pub use run_end::{Progress, RunEnd};
pub use run_stats::RunStats;
pub use yamabico_host::{BehaviorPlan, CallStats, DevicePlan, DurationHistogram, HostError, topics};
