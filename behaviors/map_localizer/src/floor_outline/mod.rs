//! The robot's pose from the outline of the floor.
//!
//! Sekimori, Usui, Masutani & Miyazaki (2001), section IV: the hull of the floor in the picture of a mirror camera, its moments for
//! a first guess, and a linear fit of the outline's corners to the lines of the plan. Differs from \[1\]: equations 16 to 19 are
//! corrected (the shift belongs to the turned frame, and the heading is less the angle of the axis), corners go to the nearest
//! segment, and a common shift of all corners in the picture may be estimated with the pose.

mod finder;
mod fit;
mod floor_plan;
mod localizer;
mod normal_equations;
mod outline;
mod plan_file;

pub use finder::FloorFinder;
pub use fit::{Fit, FitRule, OutlineFitter, Robust, Start};
pub use floor_plan::{FloorPlan, FloorPlanError, OutlineSegment};
pub use localizer::{FloorFix, FloorLocalizer, FloorProblem, FloorRule, FloorSolution};
pub use normal_equations::{LineMeasurement, NormalEquations};
pub use outline::{FloorOutline, OutlineError, OutlineRule, OutlineVertex};
pub use plan_file::{FLOOR_PLAN_FILE, FloorPlanFile};
