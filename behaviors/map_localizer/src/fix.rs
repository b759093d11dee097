//! Pose correction from one image, independent of the method.

use yamabico_core::message::{FrameHeader, Reason, View};
use yamabico_core::overlay::Overlay;
use yamabico_vision::map::WireFrame;

use crate::belief::Belief;
use crate::obstacles::UnknownEdge;

/// Matched fraction of the expected features below which a fix is weak: right poses match more in 97 of 100 images.
const WEAKLY_MATCHED: f64 = 0.6;

/// Result of matching one image with the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Belief after the update; the prior if no feature was matched.
    pub posterior: Belief,
    /// `Ok` if this is a valid fix, else the reason why not. The posterior includes the matched features in either
    /// case; it must not be used if the reason is `Ambiguous`.
    pub verdict: Result<(), Reason>,
    /// Number of features (lines, edges or corners) that updated the belief.
    pub lines: usize,
    /// Number of features of the map that should be in view.
    pub expected: usize,
    /// Number of vertical edges that should be in view, and number of these that updated the belief.
    pub uprights: [usize; 2],
    /// Normalized innovation squared (NIS) divided by its degrees of freedom, summed over the features: on average 1
    /// per feature if the covariances are consistent.
    pub nis: f64,
}

impl Fix {
    /// Creates the result of an image without a match.
    #[must_use]
    pub fn none(prior: &Belief, reason: Reason) -> Self {
        Self { posterior: *prior, verdict: Err(reason), lines: 0, expected: 0, uprights: [0; 2], nis: 0.0 }
    }

    /// Returns true if so few of the expected features were matched that another pose may explain the image better.
    #[must_use]
    pub fn is_weak(&self) -> bool {
        (self.lines as f64) < WEAKLY_MATCHED * self.expected as f64
    }

    /// Returns true if this fix of an image explains it better than another one: valid, or with more features within
    /// smaller residuals.
    #[must_use]
    pub fn is_better_than(&self, other: &Self) -> bool {
        let score = |fix: &Self| fix.lines as f64 - fix.nis;
        match (self.verdict.is_ok(), other.verdict.is_ok()) {
            (true, false) => true,
            (false, true) => false,
            _ => score(self) > score(other),
        }
    }
}

/// Factors on the variance of the measurements in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseFactors {
    /// Factor in gates and updates, adapted to the consistency of earlier measurements.
    pub scale: f64,
    /// Additional factor in updates only, >= 1: errors of images taken close to each other are correlated.
    pub correlation: f64,
}

/// Method that localizes the robot in images.
pub trait PoseFinder {
    /// Returns the walls of the map, which paths keep clear of.
    fn walls(&self) -> &WireFrame;

    /// Extracts the features of an image for the calls that follow.
    ///
    /// # Errors
    /// `MalformedInput` if the frame does not fit the camera, else the reason why the image has no usable features.
    fn observe(&mut self, frame: &View<'_, FrameHeader>) -> Result<(), Reason>;

    /// Updates a belief with the observed image.
    fn fix(&mut self, prior: &Belief, noise: NoiseFactors) -> Fix;

    /// Returns true if the method implements [`PoseFinder::recover`].
    fn can_recover(&self) -> bool {
        false
    }

    /// Searches for a pose around a prior that is somewhat wrong, although it may be certain; `None` if there is none, or
    /// more than one. The default finds none; see [`PoseFinder::can_recover`].
    fn recover(&mut self, prior: &Belief, noise: NoiseFactors) -> Option<Fix> {
        let _ = (prior, noise);
        None
    }

    /// Searches for the robot's pose in the observed image if the belief is too uncertain for [`PoseFinder::fix`];
    /// `None` if there is no solution or more than one.
    fn search(&mut self, prior: &Belief, noise: NoiseFactors) -> Option<Belief>;

    /// Tracks the features of the observed image that are not on the map, using the pose of the fix.
    fn track_unknown(&mut self) {}

    /// Forgets the features that are not on the map: the poses that located them were wrong.
    fn forget_unknown(&mut self) {}

    /// Draws the features of the last image and those of the map that it should show.
    fn draw(&self, _overlay: &mut Overlay) {}

    /// Returns the located edges that are not on the map.
    fn unknown_edges(&self) -> &[UnknownEdge] {
        &[]
    }
}
