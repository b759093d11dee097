//! Votes of an image from its look.

use thiserror::Error;

use super::boundaries::Boundaries;
use super::features::{Blocks, Feature, Picture};
use super::floor_ends::FloorEnds;
use super::learned::LearnedLook;
use super::modes::{Modes, Surfaces};
use super::one_surface::one_surface;
use super::place::{FloorPlace, Part};
use super::plumb_edges::PlumbEdges;
use super::random_walk::RandomWalk;
use super::votes::FloorVotes;

/// Weight of the log likelihood ratio; half of it for gray images.
const LOOK_WEIGHT: f32 = 0.9;
/// Maximum magnitude of the log likelihood ratio.
const MAX_LOG_RATIO: f32 = 8.0;
/// Anchor of a block that may be floor.
const ANCHOR: f32 = 0.1;
/// Anchor of blocks known to be floor or to be none.
const FIRM_ANCHOR: f32 = 1.0;
/// Minimum probability of the foreground while it is presumed to be floor.
const FOREGROUND_PROBABILITY: f32 = 0.95;
/// Number of rounds; the second fits the modes to the result of the first.
const ROUNDS: usize = 2;
/// Probability above which a block shows the floor's look in the next round.
const SURE_FLOOR: f32 = 0.8;
/// Probability below which a block shows another look in the next round.
const SURE_OTHER: f32 = 0.2;
/// Squared Mahalanobis distance up to which a block looks like what was learned.
const KNOWN_LOOK: f32 = 16.0;
/// Log odds that a block loses which a plumb edge across the horizon crosses.
const PLUMB_LOG_ODDS: f32 = 2.0;
/// Share of the ends of the floor in the log odds; the random walk has the rest.
const ENDS_SHARE: f32 = 0.1;
/// Log odds that a block which is floor by a wrong foreground loses against those of its place.
const WRONG_LOOK_LOG_ODDS: f32 = 1.0;
/// Maximum rise of the log odds above the lowest of the blocks below.
const MAX_RISE: f32 = 1.0;
/// Minimum number of blocks along either side of an image.
const MIN_BLOCKS: usize = 4;
/// Mean log intensity (with an offset of 8 levels) below which the foreground is dark: 8 gray levels.
const DARK: f32 = 2.77;

/// Reason why an image gives no votes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum AppearanceError {
    /// The image has fewer than 4 x 4 blocks.
    #[error("the image is too small")]
    TooSmall,
    /// The foreground is dark or saturates.
    #[error("the foreground is dark or overexposed")]
    NoForeground,
}

/// Observer of the floor's look. Reuses its buffers: allocates for the first image of a size only.
#[derive(Clone, Debug, Default)]
pub struct FloorAppearance {
    look: LearnedLook,
    blocks: Blocks,
    boundaries: Boundaries,
    floor: Modes,
    other: Modes,
    walk: RandomWalk,
    plumb: PlumbEdges,
    ends: FloorEnds,
    parts: Vec<Part>,
    presumed: Vec<f32>,
    /// True if the foreground is taken for floor: nothing was learned yet, or it looks like what was learned.
    trusts_foreground: bool,
    is_foreground: Vec<bool>,
    samples: Vec<Feature>,
    own: Vec<f32>,
    anchors: Vec<f32>,
    probabilities: Vec<f32>,
    votes: FloorVotes,
}

impl FloorAppearance {
    /// Creates an observer that begins with a learned look.
    #[must_use]
    pub fn with_look(look: LearnedLook) -> Self {
        Self { look, ..Self::default() }
    }

    /// Observes an image and returns its votes.
    ///
    /// # Errors
    /// The image is too small, or its foreground is dark or saturated.
    pub fn observe(&mut self, picture: Picture, place: &FloorPlace) -> Result<&FloorVotes, AppearanceError> {
        self.blocks.measure(picture);
        let grid = self.blocks.grid();
        self.votes.grid = grid;
        self.votes.is_color = self.blocks.is_color();
        self.votes.log_odds.clear();
        self.probabilities.clear();
        if grid.columns < MIN_BLOCKS || grid.rows < MIN_BLOCKS {
            return Err(AppearanceError::TooSmall);
        }
        self.reserve();
        self.presume(place);
        if !self.has_foreground() {
            return Err(AppearanceError::NoForeground);
        }
        self.trusts_foreground = !self.look.is_trusted() || self.knows_foreground();
        self.boundaries.measure(&self.blocks, &self.is_foreground);
        for _ in 0..ROUNDS {
            self.fit();
            self.weigh();
            let solved = self.walk.solve(grid.columns, &self.boundaries, &self.own, &self.anchors);
            self.probabilities.clear();
            self.probabilities.extend_from_slice(solved);
        }
        self.votes.log_odds.extend(self.probabilities.iter().map(|&probability| log_odds(probability)));
        self.end_columns();
        self.hide_behind_obstacles();
        self.doubt_foreground();
        Ok(&self.votes)
    }

    /// Returns the votes of the last image; empty after an error.
    #[must_use]
    pub fn votes(&self) -> &FloorVotes {
        &self.votes
    }

    /// Returns the blocks of the last image.
    #[must_use]
    pub fn blocks(&self) -> &Blocks {
        &self.blocks
    }

    /// Returns the learned look.
    #[must_use]
    pub fn look(&self) -> &LearnedLook {
        &self.look
    }

    /// Returns the learned look, to add samples to it.
    pub fn look_mut(&mut self) -> &mut LearnedLook {
        &mut self.look
    }

    /// Blends the log odds of the random walk with those of the ends of the floor that follow from them.
    fn end_columns(&mut self) {
        let columns = self.votes.grid.columns;
        let ended = self.ends.solve(columns, &self.boundaries, &self.votes.log_odds);
        for (walked, &ended) in self.votes.log_odds.iter_mut().zip(ended) {
            *walked += ENDS_SHARE * (log_odds(ended) - *walked);
        }
    }

    /// Limits the log odds of each block by the lowest below it: what stands on the floor hides the floor behind it.
    fn hide_behind_obstacles(&mut self) {
        let columns = self.votes.grid.columns;
        for column in 0..columns {
            let mut lowest = f32::INFINITY;
            for log_odds in self.votes.log_odds.iter_mut().skip(column).step_by(columns).rev() {
                lowest = lowest.min(*log_odds);
                *log_odds = log_odds.min(lowest + MAX_RISE);
            }
        }
    }

    /// Lowers the log odds where the foreground, which is presumed to be floor while nothing was learned, shows more than one surface:
    /// if the presumption is wrong, what looks like the foreground is floor with less than the probability of its place.
    fn doubt_foreground(&mut self) {
        if self.look.is_trusted() {
            return;
        }
        let right = one_surface(&self.blocks, &self.boundaries, &self.is_foreground);
        for (log_odds_of_block, presumed) in self.votes.log_odds.iter_mut().zip(&self.presumed) {
            let otherwise = probability(presumed - WRONG_LOOK_LOG_ODDS);
            let share = right + (1.0 - right) * otherwise;
            *log_odds_of_block = log_odds(probability(*log_odds_of_block) * share);
        }
    }

    /// Reserves what any image of this size may need.
    fn reserve(&mut self) {
        let count = self.blocks.grid().count();
        self.samples.clear();
        self.samples.reserve(count);
        self.floor.reserve(count);
        self.other.reserve(count);
    }

    fn presume(&mut self, place: &FloorPlace) {
        let grid = self.blocks.grid();
        self.parts.clear();
        self.presumed.clear();
        self.is_foreground.clear();
        for row in 0..grid.rows {
            for column in 0..grid.columns {
                let (part, log_odds) = place.presumption(&grid, column, row);
                self.parts.push(part);
                self.presumed.push(log_odds);
                self.is_foreground.push(part == Part::Foreground);
            }
        }
        for (block, _) in self
            .plumb
            .find(&self.blocks, place.horizon())
            .iter()
            .enumerate()
            .filter(|(_, is_crossed)| **is_crossed)
        {
            self.presumed[block] -= PLUMB_LOG_ODDS;
            self.is_foreground[block] = false;
            if self.parts[block] == Part::Foreground {
                self.parts[block] = Part::Open;
            }
        }
    }

    /// Returns true if at least half of the foreground is neither dark nor saturated.
    fn has_foreground(&self) -> bool {
        let looks = self.blocks.features().iter().zip(self.blocks.is_saturated());
        let (mut count, mut usable) = (0, 0);
        for ((feature, is_saturated), _) in looks.zip(&self.is_foreground).filter(|(_, is_in)| **is_in) {
            count += 1;
            usable += usize::from(!is_saturated && feature[2] > DARK);
        }
        2 * usable >= count.max(1)
    }

    /// Returns true if at least half of the foreground that does not saturate looks like what was learned; the other blocks then no
    /// longer belong to it.
    fn knows_foreground(&mut self) -> bool {
        let is_color = self.blocks.is_color();
        let is_known = |feature: &Feature| {
            let distances = self.look.modes().iter().map(|mode| mode.distance_squared(feature, is_color));
            distances.fold(f32::INFINITY, f32::min) < KNOWN_LOOK
        };
        let looks = self.blocks.features().iter().zip(self.blocks.is_saturated());
        let (mut count, mut known) = (0, 0);
        for ((feature, is_saturated), is_in) in looks.clone().zip(&self.is_foreground) {
            let counts = *is_in && !is_saturated;
            count += usize::from(counts);
            known += usize::from(counts && is_known(feature));
        }
        if 2 * known < count {
            return false;
        }
        for (((feature, is_saturated), is_in), part) in
            looks.zip(&mut self.is_foreground).zip(&mut self.parts).filter(|((_, is_in), _)| **is_in)
        {
            if !is_saturated && !is_known(feature) {
                (*is_in, *part) = (false, Part::Open);
            }
        }
        true
    }

    /// Fits the modes of the floor and of everything else.
    fn fit(&mut self) {
        let is_color = self.blocks.is_color();
        let probabilities = self.probabilities.iter().copied().map(Some).chain(std::iter::repeat(None));
        let blocks = self.blocks.features().iter().zip(&self.parts).zip(probabilities);
        self.samples.clear();
        if self.trusts_foreground {
            let usable =
                blocks.clone().zip(self.blocks.is_saturated()).filter(|(_, is_saturated)| !**is_saturated);
            self.samples.extend(usable.filter_map(|(((feature, part), probability), _)| {
                let is_floor = *part == Part::Foreground || probability.is_some_and(|p| p > SURE_FLOOR);
                is_floor.then_some(*feature)
            }));
        }
        self.floor.fit(&self.samples, &Surfaces::FLOOR, is_color);
        if self.look.is_trusted() {
            self.floor.join(self.look.modes(), is_color);
        }
        self.samples.clear();
        self.samples.extend(blocks.filter_map(|((feature, part), probability)| {
            let is_other = *part == Part::NoFloor || probability.is_some_and(|p| p < SURE_OTHER);
            is_other.then_some(*feature)
        }));
        self.other.fit(&self.samples, &Surfaces::OTHER, is_color);
    }

    /// Computes each block's own probability, and its anchor: the strength with which it keeps it.
    fn weigh(&mut self) {
        let is_color = self.blocks.is_color();
        let weight = if is_color { LOOK_WEIGHT } else { 0.5 * LOOK_WEIGHT };
        self.own.clear();
        self.anchors.clear();
        for (i, feature) in self.blocks.features().iter().enumerate() {
            let ratio = if self.blocks.is_saturated()[i] {
                0.0
            } else {
                self.floor.log_density(feature, &Surfaces::FLOOR, is_color)
                    - self.other.log_density(feature, &Surfaces::OTHER, is_color)
            };
            let probability =
                probability(self.presumed[i] + weight * ratio.clamp(-MAX_LOG_RATIO, MAX_LOG_RATIO));
            let (own, anchor) = match self.parts[i] {
                Part::NoFloor => (0.0, FIRM_ANCHOR),
                Part::Foreground if self.trusts_foreground => {
                    (probability.max(FOREGROUND_PROBABILITY), FIRM_ANCHOR)
                }
                Part::Foreground if ratio > 0.0 => (probability, FIRM_ANCHOR),
                _ => (probability, ANCHOR),
            };
            self.own.push(own);
            self.anchors.push(anchor);
        }
    }
}

fn probability(log_odds: f32) -> f32 {
    1.0 / (1.0 + (-log_odds).exp())
}

fn log_odds(probability: f32) -> f32 {
    let probability = probability.clamp(1e-4, 1.0 - 1e-4);
    (probability / (1.0 - probability)).ln()
}
