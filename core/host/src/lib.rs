//! Host of Yamabico's plugins: the bus, the configuration, and the loops in which behaviors and devices run.
//!
//! | Module          | Contents                                                                                       |
//! |-----------------|------------------------------------------------------------------------------------------------|
//! | [`bus`]         | topics over iceoryx2: publish, subscribe, wait, clean up after dead processes                  |
//! | [`config`]      | task and robot files, checked, with every mistake shown in its place                           |
//! | [`process`]     | the protocol between the supervisor and a plugin that runs in a process of its own             |
//! | [`topics`]      | names of the topics                                                                            |
//! | crate root      | hosts ([`BehaviorHost`], [`DeviceHost`]), their loops, settings and statistics                 |
//!
//! A host connects one plugin to the bus. The same hosts serve a plugin in lockstep, on a thread and in a process of
//! its own; only what calls them differs:
//!
//! - lockstep: the runtime calls `collect` and `propose` in the order of priority;
//! - live: [`run_behavior`] and [`run_device`] loop until the run is over;
//! - live, with the clock of a driver: [`follow_steps`] and [`lead_steps`].
//!
//! A message from a publisher to a subscriber, here within one process:
//!
//! ```
//! use yamabico_core::message::Odometry;
//! use yamabico_host::bus::{Bus, TopicSpec};
//! use yamabico_host::topics;
//!
//! let bus = Bus::local("example")?;
//! bus.create::<Odometry>(&topics::sensor("wheels"), &TopicSpec::default())?;
//! let wheels = bus.publisher::<Odometry>(&topics::sensor("wheels"))?;
//! let odometry = bus.subscriber::<Odometry>(&topics::sensor("wheels"))?;
//! wheels.publish(&Odometry { x: 0.5, ..Odometry::default() }, &[])?;
//! assert_eq!(odometry.receive()?.expect("one message is waiting").header().x, 0.5);
//! # Ok::<(), yamabico_host::bus::BusError>(())
//! ```

mod behavior_host;
pub mod bus;
mod call_log;
mod candidate;
pub mod config;
mod device_host;
mod error;
mod histogram;
mod input_ports;
mod loops;
mod output_ports;
mod overlay_port;
pub mod process;
mod reporter;
mod scheduling;
mod settings;
mod steps;
pub mod topics;
mod tuner;

pub use behavior_host::{BehaviorHost, BehaviorPlan, CallStats};
pub use call_log::MAX_CALL_INPUTS;
pub use device_host::{DeviceHost, DevicePlan, panic_text};
pub use error::HostError;
pub use histogram::DurationHistogram;
pub use loops::{run_behavior, run_device};
pub use reporter::{MAX_FAILURE_TEXT_BYTES, MAX_WALL_POINTS, PluginReporter};
pub use scheduling::{CpuList, Scheduling, SchedulingError};
pub use settings::{BehaviorSettings, Deadline, HostSettings};
pub use steps::{StepFollower, StepLeader, follow_steps, lead_steps};
pub use tuner::MAX_PARAMETER_BYTES;
