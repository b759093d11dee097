//! What a picture tells of the pose, by whatever method.

use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_vision::map::WireFrame;

use crate::belief::Belief;
use crate::obstacles::UnknownEdge;

/// What a picture told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// The belief after it; the prior where nothing was matched.
    pub posterior: Belief,
    /// Whether it counts, or why not. What was matched moved the belief also where it does not count; where that is because it
    /// is ambiguous, the posterior is not to be used.
    pub verdict: Result<(), Reason>,
    /// Lines, edges or corners that moved the belief.
    pub lines: usize,
    /// Of these, how many should be in view.
    pub expected: usize,
    /// Upright edges that should be in view, and of these the ones that moved the belief.
    pub uprights: [usize; 2],
    /// Squared distances over their degrees of freedom, summed over the lines: 1 a line where covariances are honest.
    pub surprise: f64,
}

impl Fix {
    /// One that told nothing.
    #[must_use]
    pub fn none(prior: &Belief, reason: Reason) -> Self {
        Self {
            posterior: *prior,
            verdict: Err(reason),
            lines: 0,
            expected: 0,
            uprights: [0; 2],
            surprise: 0.0,
        }
    }
}

/// How far what a picture shows can be trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trust {
    /// Factor on the variance, from how well earlier measurements agreed.
    pub scale: f64,
    /// Factor on the variance where a measurement moves the belief, >= 1: pictures from nearly one place err alike.
    pub repetition: f64,
}

/// A way to find the robot in pictures.
pub trait PoseFinder {
    /// The walls of the map, which paths keep clear of.
    fn walls(&self) -> &WireFrame;

    /// Takes a picture.
    ///
    /// # Errors
    /// `MalformedInput` where it is no picture of this camera; why it tells nothing.
    fn take(&mut self, frame: &View<'_, FrameHeader>) -> Result<(), Reason>;

    /// What the picture taken last makes of a belief.
    fn fix(&mut self, prior: &Belief, trust: Trust) -> Fix;

    /// The robot in the picture taken last, where the belief is too vague for [`PoseFinder::fix`]; `None` where it is found
    /// nowhere, or in two places.
    fn search(&mut self, prior: &Belief, trust: Trust) -> Option<Belief>;

    /// Follows what the picture taken last shows beside the map, seen from where the fix placed the robot.
    fn follow_unknown(&mut self) {}

    /// Edges that the map does not explain, as far as they are known to stand where they do.
    fn unknown_edges(&self) -> &[UnknownEdge] {
        &[]
    }
}
