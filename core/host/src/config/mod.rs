//! TOML to a checked configuration; all errors are reported at once, with their source spans.
//!
//! `task file + robot file + overrides -> load -> Task`
//!
//! Parameters are checked against JSON Schemas, which [`describe()`] and [`schema()`] show as well. Nothing here opens a
//! device.

mod checks;
mod describe;
mod exec;
mod graph;
mod inputs;
mod keys;
mod limits;
mod load;
mod overrides;
mod paths;
mod read_file;
mod read_robot;
mod read_task;
mod retune;
mod robot;
mod schema;
mod source_map;
mod substitutes;
mod tables;
mod task;
mod wires;

pub use describe::{
    Description, Listed, Listing, Parameter, Port, describe, describe_in_task, describe_parameters, list,
};
pub use exec::program_for;
pub use graph::{Graph, GraphEdge, GraphLine, GraphNode, GraphPart, graph};
pub use load::load;
pub use overrides::Overrides;
pub use paths::absolute;
pub use retune::{assignments, retune};
pub use robot::{DeviceFile, DriveFile, RobotFile, SensorFile};
pub use schema::{robot_schema, schema, schema_with_programs, task_schema};
pub use source_map::Part;
pub(crate) use tables::{ArbiterKeys, BehaviorKeys, DeviceKeys};
pub use tables::{Clock, Isolation, Policy};
pub use task::{Arbiter, BehaviorFile, GoalArea, Input, InputSource, Run, Task, Wire};
