//! Evidence of one image: the most likely hypothesis with its features and probability, the horizon and the foot line.

use super::false_alarms::Agreement;
use super::features::Features;
use super::foot_line::{FootLine, FootLineFinder};
use super::picture::Picture;
use super::plumb_lines::{PlumbHorizon, PlumbLineFit};
use super::probability::Coefficients;
use super::row_prior::RowPrior;
use super::scene_lines::{MAX_VOTERS, SceneLines};
use super::search::{Hypothesis, HypothesisSearch, REFINE};
use super::support;
use super::track::NO_HYPOTHESIS;
use crate::segments::Segment;
use crate::vanishing_point::{VotingLine, refine};
use nalgebra::Vector2;

/// Lower bound of the weight of a hypothesis away from the predicted heading.
const MIN_PREDICTION: f64 = 0.05;
/// Judgment of one image: a corridor, or none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Most likely vanishing point, pixels of an image 640 px wide; `None` if no lines meet.
    pub hypothesis: Option<Hypothesis>,
    /// Its features.
    pub features: Features,
    /// Probability that a corridor is in view and that the point is its vanishing point, 0 to 1.
    pub probability: f64,
    /// Roll and horizon by plumb lines, if there are any.
    pub plumb: Option<PlumbHorizon>,
}

/// Predicted heading of the camera from the corridor's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedHeading {
    /// Heading, rad, positive to the left.
    pub heading: f64,
    /// Standard deviation, rad, > 0.
    pub sigma: f64,
}

/// Finds the corridor in the segments of an image and judges it. Reuses its buffers.
#[derive(Clone, Debug)]
pub struct CorridorJudge {
    coefficients: Coefficients,
    /// Share of images that show a corridor.
    prior: f64,
    lines: SceneLines,
    search: HypothesisSearch,
    plumb: PlumbLineFit,
    foot: FootLineFinder,
    kappas: Vec<f64>,
    is_part: Vec<bool>,
    near: Vec<VotingLine>,
    inliers: Vec<usize>,
}

impl CorridorJudge {
    /// Creates a judge with these coefficients for images of which the share `prior` shows a corridor.
    #[must_use]
    pub fn new(coefficients: Coefficients, prior: f64) -> Self {
        Self {
            coefficients,
            prior,
            lines: SceneLines::default(),
            search: HypothesisSearch::default(),
            plumb: PlumbLineFit::default(),
            foot: FootLineFinder::default(),
            kappas: Vec::with_capacity(MAX_VOTERS),
            is_part: Vec::with_capacity(MAX_VOTERS),
            near: Vec::with_capacity(MAX_VOTERS),
            inliers: Vec::with_capacity(MAX_VOTERS),
        }
    }

    /// Judges the segments of an image (pixels of the camera, undistorted). A prediction influences which hypothesis is chosen,
    /// never its probability.
    pub fn look(
        &mut self,
        segments: &[Segment],
        picture: &Picture,
        prior: &RowPrior,
        predicted: Option<PredictedHeading>,
    ) -> Sighting {
        let plumb = self.take(segments, picture, prior);
        self.choose(segments, picture, prior, predicted, plumb)
    }

    /// Takes the segments of an image, and estimates roll and horizon by the plumb lines among them; `None` if they are too few. Where
    /// their roll is not known well, that of `prior` classifies the segments.
    pub fn take(
        &mut self,
        segments: &[Segment],
        picture: &Picture,
        prior: &RowPrior,
    ) -> Option<PlumbHorizon> {
        self.lines.take(segments, picture);
        let plumb = self.plumb.fit(self.lines.all(), picture);
        self.lines.classify(plumb.and_then(|plumb| plumb.known_roll()).unwrap_or((-prior.slope).atan()));
        plumb
    }

    /// Chooses and judges a hypothesis among the segments taken last.
    pub fn choose(
        &mut self,
        segments: &[Segment],
        picture: &Picture,
        prior: &RowPrior,
        predicted: Option<PredictedHeading>,
        plumb: Option<PlumbHorizon>,
    ) -> Sighting {
        self.search.find(self.lines.voters(), picture);
        let weight = |hypothesis: &Hypothesis| {
            let ahead = predicted.map_or(1.0, |predicted| {
                let off = (picture.heading_of(hypothesis.point.x) - predicted.heading) / predicted.sigma;
                (-0.5 * off * off).exp().max(MIN_PREDICTION)
            });
            (hypothesis.score * ahead + 1e-9).ln() + prior.ln_likelihood(picture, hypothesis.point)
        };
        let mut best: Option<(usize, f64)> = None;
        for (index, hypothesis) in self.search.found().iter().enumerate() {
            let weight = weight(hypothesis);
            if best.is_none_or(|(_, most)| weight > most) {
                best = Some((index, weight));
            }
        }
        let Some((index, _)) = best else {
            let (features, probability) = (Features::default(), NO_HYPOTHESIS);
            return Sighting { hypothesis: None, features, probability, plumb };
        };
        let chosen = self.search.found()[index];
        let features = self.features(segments, picture, &chosen, Some(index));
        let probability = self.coefficients.probability(&features, self.prior);
        Sighting { hypothesis: Some(chosen), features, probability, plumb }
    }

    /// Computes the features of a point in the last image. `index` is its own among the hypotheses of that image.
    pub fn features(
        &mut self,
        segments: &[Segment],
        picture: &Picture,
        chosen: &Hypothesis,
        index: Option<usize>,
    ) -> Features {
        let voters = self.lines.voters();
        support::kappas(voters, chosen.point, &mut self.kappas);
        let agreement = Agreement::count(voters, chosen.point, &mut self.is_part);
        let foot = self.foot.find(segments, picture, chosen.point.y);
        let others = self.search.found().iter().enumerate();
        Features::of(
            chosen,
            others.filter(|(other, _)| Some(*other) != index).map(|(_, other)| other),
            voters,
            &self.kappas,
            agreement.log10_false_alarms(),
            foot.map_or(0.0, |foot| foot.coverage),
            picture,
        )
        .with_clear_edges(voters, &self.kappas, segments)
    }

    /// Fills `members` with the segments of the last image that meet at `point`.
    pub fn members(&mut self, point: Vector2<f64>, members: &mut Vec<usize>) {
        self.near.clear();
        self.near.extend(self.lines.voters().iter().filter(|line| !line.straddles(point)));
        members.clear();
        if refine(&self.near, point, &REFINE, &mut self.inliers).is_ok() {
            members.extend(self.inliers.iter().map(|&inlier| self.near[inlier].segment));
        }
    }

    /// Returns the foot line of a wall ahead, below a horizon at `row`, pixels of an image 640 px wide.
    pub fn foot_line(&mut self, segments: &[Segment], picture: &Picture, row: f64) -> Option<FootLine> {
        self.foot.find(segments, picture, row)
    }

    /// Segments of the last image by direction.
    #[must_use]
    pub fn lines(&self) -> &SceneLines {
        &self.lines
    }

    /// Hypotheses of the last image, in the order of their votes.
    #[must_use]
    pub fn hypotheses(&self) -> &[Hypothesis] {
        self.search.found()
    }
}
