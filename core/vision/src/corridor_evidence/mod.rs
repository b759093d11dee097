//! Evidence for a corridor in one image and over time: a vanishing point, found without presuming the horizon, and the
//! probability that a corridor is in view and that the point belongs to it.
//!
//! | Step | Modules |
//! |---|---|
//! | Segments by direction, at one scale | [`picture`], [`scene_lines`] |
//! | Hypotheses: votes, refinement, score | [`search`], [`support`], [`row_prior`] |
//! | Horizon and roll from plumb lines | [`plumb_lines`] |
//! | Features of a hypothesis | [`features`], [`false_alarms`], [`foot_line`] |
//! | Probability and action | [`probability`] |
//! | From image to image | [`track`] |
//! | All of them on the segments of one image | [`judge`] |
//!
//! All lengths are pixels of an image 640 px wide ([`Picture`] converts), so that one set of parameters holds for every camera.
//!
//! Sources: Kweon, Kuno et al. (1991) for the votes; Barinova, Lempitsky, Tretiak and Kohli (ECCV 2010) for the order (zenith,
//! then horizon, then horizontal points); Lezama, Grompone von Gioi, Randall and Morel (CVPR 2014) and Desolneux, Moisan and Morel
//! for the number of false alarms; Simon, Fond and Berger (ECCV 2018) for horizon hypotheses; Hoeffding (1956) for the bound.

pub mod false_alarms;
pub mod features;
pub mod foot_line;
pub mod judge;
pub mod picture;
pub mod plumb_lines;
pub mod probability;
pub mod row_prior;
pub mod scene_lines;
pub mod search;
pub mod support;
pub mod track;

pub use features::Features;
pub use foot_line::{FootLine, WallAhead};
pub use judge::{CorridorJudge, Sighting};
pub use picture::Picture;
pub use probability::{Action, Coefficients};
pub use row_prior::RowPrior;
pub use scene_lines::SceneLines;
pub use search::{Hypothesis, HypothesisSearch};
pub use track::EvidenceTrack;
