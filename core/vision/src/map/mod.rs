//! A-priori map of a building.
//!
//! [`WireFrame`] holds its edges and walls, [`ExpectationMap`] predicts the edges visible from a pose.

pub mod expectation;
pub mod view;
pub mod wire_frame;

pub use expectation::{ExpectationMap, ExpectationRules, ExpectedEdge};
pub use view::MapView;
pub use wire_frame::{Edge, EdgeKind, EdgeRole, WIRE_FRAME_FILE, Wall, WireFrame};
