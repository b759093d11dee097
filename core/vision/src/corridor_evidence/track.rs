//! Evidence from image to image: heading, row of the horizon, and the log-odds of a corridor.

use super::picture::Picture;
use super::probability::{log_odds, probability};
use super::row_prior::RowPrior;
use nalgebra::Vector2;

/// Share of an image's evidence that is independent of the preceding images.
const INDEPENDENT: f64 = 0.5;
/// Probability, per image and per [`CHANGE_M`] driven, that a corridor ends or begins.
const CHANGE: f64 = 0.05;
const CHANGE_M: f64 = 10.0;
/// Bound of the log-odds.
const MAX_LOG_ODDS: f64 = 8.0;
/// Bound of the evidence from agreement with the predicted heading.
const MAX_AGREEMENT: f64 = 2.0;
/// Standard deviation of a heading in one image, rad, at probability 1.
const HEADING_SIGMA_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Standard deviation of a row in one image, px, at probability 1, and its lower bound in heights of the image.
const ROW_SIGMA_PX: f64 = 4.0;
const ROW_SIGMA_HEIGHTS: f64 = 0.01;
/// Growth of the row's variance per image, px^2.
const ROW_DRIFT_PX2: f64 = 4.0;
/// Change of the heading up to which a measurement is always accepted, rad.
const HEADING_GATE_RAD: f64 = 0.045;
/// Number of consecutive rejected images after which the state is reset to the last one.
const REFUSALS: u32 = 3;
/// Probability of an image without any hypothesis.
pub const NO_HYPOTHESIS: f64 = 0.02;
/// Maximum log-odds by which the track may exceed the evidence of a single image.
const AHEAD_OF_IMAGE: f64 = 0.4;

/// Scalar state with its variance and the number of consecutive rejected images.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scalar {
    value: f64,
    variance: f64,
    refused: u32,
}

impl Scalar {
    fn new(value: f64, variance: f64) -> Self {
        Self { value, variance, refused: 0 }
    }

    /// Accepts a measurement if `|innovation| <= gate`; after [`REFUSALS`] rejections, resets the state to it.
    fn update(&mut self, measured: f64, variance: f64, gate: f64) {
        let innovation = measured - self.value;
        if innovation.abs() <= gate {
            let gain = self.variance / (self.variance + variance);
            *self = Self::new(self.value + gain * innovation, self.variance * (1.0 - gain));
        } else {
            self.refused += 1;
            if self.refused >= REFUSALS {
                *self = Self::new(measured, variance);
            }
        }
    }
}

/// State of the evidence over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EvidenceTrack {
    start: RowPrior,
    row: Scalar,
    has_row: bool,
    heading: Option<Scalar>,
    log_odds: f64,
}

impl EvidenceTrack {
    /// Starts from the prior of the first image: even odds, no heading.
    #[must_use]
    pub fn new(start: RowPrior) -> Self {
        let row = Scalar::new(start.row, start.variance);
        Self { start, row, has_row: false, heading: None, log_odds: 0.0 }
    }

    /// Propagates to the next image, over a turn (rad, positive to the left) with its standard deviation and a distance driven, m.
    pub fn predict(&mut self, turn: f64, turn_sigma: f64, meters: f64) {
        if let Some(heading) = &mut self.heading {
            heading.value += turn;
            heading.variance += turn_sigma * turn_sigma;
        }
        self.row.variance = (self.row.variance + ROW_DRIFT_PX2).min(self.start.variance);
        let change = CHANGE.max(1.0 - (-meters / CHANGE_M).exp());
        let p = self.probability();
        self.log_odds = log_odds(p * (1.0 - change) + (1.0 - p) * change);
    }

    /// Updates by the best hypothesis of an image and its probability; `None` if there is no hypothesis.
    pub fn update(&mut self, picture: &Picture, seen: Option<(Vector2<f64>, f64)>) {
        let (point, p) = seen.map_or((None, NO_HYPOTHESIS), |(point, p)| (Some(point), p));
        let accepted = point.filter(|_| p >= 0.5);
        let heading = accepted.map(|point| picture.heading_of(point.x));
        let agreement = heading.map_or(0.0, |heading| self.agreement(picture, heading));
        let evidence = log_odds(p.clamp(1e-6, 1.0 - 1e-6)) + agreement;
        self.log_odds = (self.log_odds + INDEPENDENT * evidence).clamp(-MAX_LOG_ODDS, MAX_LOG_ODDS);
        let (Some(point), Some(heading)) = (accepted, heading) else { return };

        let row_variance = (ROW_SIGMA_PX / p).powi(2) + (ROW_SIGMA_HEIGHTS * picture.height).powi(2);
        let row = point.y - self.start.slope * (point.x - picture.center.x);
        let gate = 3.0 * (self.row.variance + row_variance).sqrt();
        self.row.update(row, row_variance, gate);
        self.has_row = true;

        let variance = (HEADING_SIGMA_RAD / p).powi(2);
        match &mut self.heading {
            Some(known) => {
                let gate = (3.0 * (known.variance + variance).sqrt()).max(HEADING_GATE_RAD);
                known.update(heading, variance, gate);
            }
            None => self.heading = Some(Scalar::new(heading, variance)),
        }
    }

    /// Sets the slope of plumb lines in the image, du/dv, rad.
    pub fn set_roll(&mut self, roll: f64) {
        self.start.slope = -roll.tan();
    }

    /// Forgets the heading and the evidence, and doubles the uncertainty of the row: after a large turn or a long time without a
    /// corridor.
    pub fn forget_heading(&mut self) {
        if self.heading.take().is_some() {
            self.row.variance = (4.0 * self.row.variance).min(self.start.variance);
        }
        self.log_odds = 0.0;
    }

    /// Probability of a corridor, 0 to 1.
    #[must_use]
    pub fn probability(&self) -> f64 {
        probability(self.log_odds)
    }

    /// Probability to act on after an image of this probability; the end of a corridor takes effect at once.
    #[must_use]
    pub fn acting_probability(&self, of_image: f64) -> f64 {
        self.probability().min(of_image + AHEAD_OF_IMAGE)
    }

    /// Heading of the camera from the axis, rad, positive to the left, with its standard deviation.
    #[must_use]
    pub fn heading(&self) -> Option<(f64, f64)> {
        self.heading.map(|heading| (heading.value, heading.variance.sqrt()))
    }

    /// Row of the horizon at the principal column, px, with its standard deviation.
    #[must_use]
    pub fn row(&self) -> (f64, f64) {
        (self.row.value, self.row.variance.sqrt())
    }

    /// Prior of the row in the next image.
    #[must_use]
    pub fn row_prior(&self) -> RowPrior {
        RowPrior { row: self.row.value, variance: self.row.variance, is_tracked: self.has_row, ..self.start }
    }

    /// Evidence of a heading (rad) that agrees with the prediction: a wrong point falls anywhere in the field of view.
    fn agreement(&self, picture: &Picture, heading: f64) -> f64 {
        let Some(known) = self.heading else { return 0.0 };
        let variance = known.variance + HEADING_SIGMA_RAD * HEADING_SIGMA_RAD;
        let off = heading - known.value;
        let density = (std::f64::consts::TAU * variance).sqrt();
        let ratio = (picture.field_of_view() / density).ln() - 0.5 * off * off / variance;
        ratio.clamp(-MAX_AGREEMENT, MAX_AGREEMENT)
    }
}
