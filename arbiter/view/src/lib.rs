//! Shows a running or a recorded robot.
//!
//! | module | contents |
//! |---|---|
//! | [`model`] | the state of a robot as people look at it, from the messages of a run |
//! | [`live`] | a running robot as a source of the model |
//! | [`recording`] | a recording: its events, and the state at any time |
//! | [`recent`] | the last minute of a running robot, to be saved |
//! | [`server`] | the page in the browser |
//! | [`top`] | the dashboard in the terminal |

pub mod live;
pub mod model;
pub mod recent;
pub mod recording;
pub mod server;
pub mod top;
