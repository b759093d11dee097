//! Probability that a corridor is in view and its vanishing point right, and what to do with it.

use super::features::Features;

/// Coefficients of the logistic regression on [`Features`].
///
/// Valid for one segment detector. After a change of the detector, fit them again as a constant with the next number, and
/// measure the reliability on recorded images again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// Constant term.
    pub constant: f64,
    /// Coefficient of each feature.
    pub features: Features,
}

impl Coefficients {
    /// For this project's segments of at least 15 px, at most 600 of an image; second fit. Fitted to photographs and drives through
    /// corridors, to pictures without any (weight 0.55), and to rendered views of plain and of furnished corridors, by L2-regularized
    /// regression, checked in eight folds by neighboring pictures. Beside the clear edges, the share of all edges, the margin and the
    /// foot line add nothing.
    pub const SEGMENTS_2: Self = Self {
        constant: -6.459,
        features: Features {
            support_share: 0.0,
            quadrants: 0.983,
            outside: -7.778,
            margin: 0.0,
            not_by_chance: 0.552,
            foot: 0.0,
            clear_share: 7.999,
        },
    };

    /// Log-odds of a hypothesis with these features. `prior` is the share of images that show a corridor, 0.05 to 0.95.
    #[must_use]
    pub fn log_odds(&self, features: &Features, prior: f64) -> f64 {
        let c = &self.features;
        self.constant
            + c.support_share * features.support_share
            + c.quadrants * features.quadrants
            + c.outside * features.outside
            + c.margin * features.margin
            + c.not_by_chance * features.not_by_chance
            + c.foot * features.foot
            + c.clear_share * features.clear_share
            + log_odds(prior.clamp(0.05, 0.95))
    }

    /// Probability of a hypothesis with these features; see [`Coefficients::log_odds`].
    #[must_use]
    pub fn probability(&self, features: &Features, prior: f64) -> f64 {
        probability(self.log_odds(features, prior))
    }
}

/// Probability from log-odds.
#[must_use]
pub fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

/// Log-odds of a probability strictly between 0 and 1.
#[must_use]
pub fn log_odds(probability: f64) -> f64 {
    (probability / (1.0 - probability)).ln()
}

/// Motion that a probability allows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Action {
    /// Drive at the normal speed.
    Drive,
    /// Drive slowly.
    Slow,
    /// Do not follow the hypothesis: there may be no corridor.
    #[default]
    Abstain,
}

impl Action {
    /// Returns the action at this probability, with hysteresis.
    #[must_use]
    pub fn next(self, probability: f64) -> Self {
        let (drive, slow) = match self {
            Self::Drive => (0.8, 0.5),
            Self::Slow => (0.9, 0.5),
            Self::Abstain => (0.9, 0.6),
        };
        if probability >= drive {
            Self::Drive
        } else if probability >= slow {
            Self::Slow
        } else {
            Self::Abstain
        }
    }

    /// Share of the normal speed, 0 to 1.
    #[must_use]
    pub fn speed_share(self, probability: f64) -> f64 {
        match self {
            Self::Drive => 1.0,
            Self::Slow => (0.3 + 0.7 * (probability - 0.5) / 0.4).clamp(0.0, 1.0),
            Self::Abstain => 0.0,
        }
    }
}
