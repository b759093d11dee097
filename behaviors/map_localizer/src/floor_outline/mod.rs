//! Localization by the outline of the floor in the images of a mirror camera.
//!
//! Sekimori, Usui, Masutani & Miyazaki (2001) \[1\], section IV: the convex hull of the floor in the image, its moments
//! as an initial guess, and a linear fit of the hull's corners to the lines of a floor plan. Differs from \[1\]:
//! equations 16 to 19 are corrected (the shift is in the rotated frame, and the heading is minus the angle of the
//! axis), corners are assigned to the nearest segment, and a common radial shift of all corners in the image can be
//! estimated with the pose.

mod finder;
mod fit;
mod floor_fix;
mod floor_plan;
mod localizer;
mod normal_equations;
mod outline;
pub mod overlay;
mod plan_file;

pub use finder::FloorFinder;
pub use fit::{Fit, FitRule, OutlineFitter, PlanPlacement, Robust};
pub use floor_fix::{FloorFix, FloorProblem, FloorSolution};
pub use floor_plan::{FloorPlan, FloorPlanError, OutlineSegment};
pub use localizer::{FloorLocalizer, FloorRule};
pub use normal_equations::{LineMeasurement, NormalEquations};
pub use outline::{FloorOutline, OutlineError, OutlineRule, OutlineVertex};
pub use plan_file::{FLOOR_PLAN_FILE, FloorPlanFile};
