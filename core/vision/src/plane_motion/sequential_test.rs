//! Sequential decision floor, above, below or moving for one feature over pictures.
//!
//! Wald (1945).

use serde::{Deserialize, Serialize};

/// Kinds of scene points, by their motion between two pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PointClass {
    /// Not yet known.
    #[default]
    Undecided,
    /// Part of the floor: joint, pattern, shadow.
    Floor,
    /// Above the floor: a thing or a wall.
    Above,
    /// Seemingly below the floor: a mirror image.
    Below,
    /// Fits no static point.
    Moving,
}

/// Costs of one picture: half the chi squares of the best fit of each class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassCosts {
    /// On the floor.
    pub floor: f64,
    /// Above it.
    pub above: f64,
    /// Below it.
    pub below: f64,
    /// Expectation of the right class.
    pub expected: f64,
}

impl ClassCosts {
    /// Costs by class: floor, above, below.
    #[must_use]
    pub fn by_class(&self) -> [f64; 3] {
        [self.floor, self.above, self.below]
    }

    /// Smallest cost.
    #[must_use]
    pub fn best(&self) -> f64 {
        self.floor.min(self.above).min(self.below)
    }

    /// Log likelihood ratio of a class against the best other one: floor, above, below.
    #[must_use]
    pub fn advantages(&self) -> [f64; 3] {
        let [floor, above, below] = self.by_class();
        [above.min(below) - floor, floor.min(below) - above, floor.min(above) - below]
    }
}

/// Parameters of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SequentialRules {
    /// Maximum log likelihood that one picture adds.
    pub cap: f64,
    /// Factor on old evidence for each picture.
    pub decay: f64,
    /// Log likelihood that decides; ln 99 errs once in a hundred.
    pub accept: f64,
    /// Log likelihood below which a decision is dropped.
    pub forget: f64,
    /// Multiple of the expected cost above which no class fits.
    pub fit_limit: f64,
}

impl Default for SequentialRules {
    fn default() -> Self {
        Self { cap: 3.0, decay: 0.98, accept: 4.6, forget: -2.0, fit_limit: 2.5 }
    }
}

/// Pictures in a row without fit that make a point moving.
const MOVING_PICTURES: u8 = 3;
const CLASSES: [PointClass; 3] = [PointClass::Floor, PointClass::Above, PointClass::Below];

/// State of the test for one feature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SequentialTest {
    log_likelihood: [f64; 3],
    unfit: u8,
    class: PointClass,
}

impl SequentialTest {
    /// Adds the costs of a picture with a sufficient baseline. At standstill nothing may be added: the pictures repeat
    /// the same noise.
    pub fn add(&mut self, costs: &ClassCosts, rules: &SequentialRules) -> PointClass {
        let fits = costs.best() <= rules.fit_limit * costs.expected;
        for (sum, advantage) in self.log_likelihood.iter_mut().zip(costs.advantages()) {
            *sum *= rules.decay;
            if fits {
                *sum += advantage.clamp(-rules.cap, rules.cap);
            }
        }
        self.unfit = if fits { self.unfit.saturating_sub(1) } else { (self.unfit + 1).min(MOVING_PICTURES) };
        self.decide(rules);
        self.class
    }

    fn decide(&mut self, rules: &SequentialRules) {
        if self.unfit == MOVING_PICTURES {
            self.class = PointClass::Moving;
            return;
        }
        let decided = CLASSES.iter().position(|class| *class == self.class);
        let is_forgotten = decided.is_some_and(|i| self.log_likelihood[i] < rules.forget);
        if is_forgotten || (self.class == PointClass::Moving && self.unfit == 0) {
            self.class = PointClass::Undecided;
        }
        let mut best = 0;
        for i in 1..3 {
            if self.log_likelihood[i] > self.log_likelihood[best] {
                best = i;
            }
        }
        if self.log_likelihood[best] >= rules.accept {
            self.class = CLASSES[best];
        }
    }

    /// Current decision.
    #[must_use]
    pub fn class(&self) -> PointClass {
        self.class
    }

    /// Log likelihoods of floor, above and below.
    #[must_use]
    pub fn log_likelihood(&self) -> [f64; 3] {
        self.log_likelihood
    }
}
