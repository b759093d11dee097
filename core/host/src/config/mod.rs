//! TOML to a checked configuration; every mistake at once, with a pointer to the place.
//!
//! `task file + robot file + overrides -> load -> Task`
//!
//! Whatever a plugin takes is checked against its JSON Schema, so that [`describe`], [`schema`] and the diagnostics say
//! the same. Nothing here opens a device.

mod describe;
mod exec;
mod graph;
mod inputs;
mod keys;
mod limits;
mod load;
mod overrides;
mod paths;
mod places;
mod read_robot;
mod read_task;
mod retune;
mod robot;
mod schema;
mod tables;
mod task;
mod wires;

pub use describe::{Description, Listed, Listing, Parameter, Port, describe, list};
pub use graph::{Graph, GraphEdge, GraphLine, GraphNode, GraphPart, graph};
pub use load::load;
pub use overrides::Overrides;
pub use places::Part;
pub use retune::{assignments, retune};
pub use robot::{DeviceFile, DriveFile, RobotFile, SensorFile};
pub use schema::{robot_schema, schema, task_schema};
pub use tables::{Clock, Isolation, Policy};
pub use task::{Arbiter, BehaviorFile, GoalArea, Input, InputSource, Run, Task, Wire};
