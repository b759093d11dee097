//! The interfaces for authors of plugins: messages, the interfaces of behaviors, sensors and drives, time, and a test bench.
//!
//! A robot runs independent *behaviors*. Each one receives sensor messages and proposes a motion; the arbiter decides, at a
//! fixed rate, what the motors get:
//!
//! `Frame -> Behavior::propose -> Proposal -> arbiter::decide -> Command -> Drive`
//!
//! | Module | Contents |
//! |---|---|
//! | [`behavior`] | The interface of a behavior: [`Plugin`](behavior::Plugin), [`Behavior`](behavior::Behavior), its inputs and outputs |
//! | [`sensor`], [`drive`] | The interfaces of a [`Sensor`](sensor::Sensor) and of a [`Drive`](drive::Drive) |
//! | [`driver`] | The interface of a [`Driver`](driver::Driver), which opens devices with their sensors and drives |
//! | [`device_file`] | Device files of the operating system, and the remedies for their errors |
//! | [`message`] | All message types, such as [`FrameHeader`](message::FrameHeader), [`Proposal`](message::Proposal) and [`Command`](message::Command) |
//! | [`testing`] | [`Bench`](testing::Bench), which runs one behavior without robot, bus and clock |
//! | [`time`], [`odometry_track`] | Time stamps, and the robot's pose at a recent time |
//! | [`geometry`], [`camera`], [`image`] | Poses, twists, camera models and images (crate `yamabico-geometry`) |
//! | [`parameters`] | Schemas and errors of parameters (crate `yamabico-parameters`) |
//! | [`plugins`] | The set of plugins that configuration files can name |
//!
//! A complete behavior, and its test:
//!
//! ```
//! use yamabico_core::behavior::{Behavior, ParameterError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo};
//! use yamabico_core::message::{Axes, Beam, Kind, Proposal, RangeScanHeader, Reason, Twist};
//! use yamabico_core::testing::Bench;
//!
//! const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges ahead");
//!
//! struct Creeper(Config);
//!
//! #[derive(serde::Deserialize, schemars::JsonSchema)]
//! struct Config {
//!     /// Distance at which the robot stops.
//!     #[schemars(range(min = 0.1, max = 5.0))]
//!     gap_m: f64,
//! }
//!
//! impl Plugin for Creeper {
//!     type Config = Config;
//!     const NAME: &'static str = "creeper";
//!     const SUMMARY: &'static str = "Drives straight ahead until an obstacle is near.";
//!     const INPUTS: &'static [SlotInfo] = &[SONAR.info()];
//!     const CLAIMS: Axes = Axes::LINEAR;
//!
//!     fn new(config: Config, _: &Setup) -> Result<Self, ParameterError> {
//!         Ok(Creeper(config))
//!     }
//! }
//!
//! impl Behavior for Creeper {
//!     fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
//!         let Some(scan) = inputs.latest(&SONAR) else { return Proposal::abstain(Reason::NoInput) };
//!         if scan.items.iter().filter_map(Beam::echo_m).any(|range_m| range_m < self.0.gap_m) {
//!             return Proposal::abstain(Reason::Echo);
//!         }
//!         Proposal::drive(Axes::LINEAR, Twist::planar(0.3, 0.0))
//!     }
//! }
//!
//! let mut bench = Bench::<Creeper>::new("gap_m = 0.5", Setup::default())?;
//! let near = Beam { range_m: 0.4, ..Beam::default() };
//! bench.at(1.0).feed(&SONAR, &RangeScanHeader::default(), &[near]);
//! assert_eq!(bench.propose().kind(), Some(Kind::Abstain));
//! bench.at(1.1).feed(&SONAR, &RangeScanHeader::default(), &[]);
//! assert_eq!(bench.propose().twist.linear, 0.3);
//! # Ok::<(), ParameterError>(())
//! ```

pub mod behavior;
pub mod device_file;
pub mod drive;
pub mod driver;
mod gyro_track;
pub mod message;
pub mod odometry_track;
pub mod overlay;
pub mod plugins;
pub mod range_scan;
pub mod sensor;
pub mod sonar_ring;
pub mod testing;
pub mod time;

pub use yamabico_geometry as geometry;
pub use yamabico_geometry::{camera, image};
pub use yamabico_parameters as parameters;
