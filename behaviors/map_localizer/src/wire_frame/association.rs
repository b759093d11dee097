//! Which line of the picture belongs to which edge of the map: one to one, and nothing that is ambiguous.

/// A line of the picture that may be an edge of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Number of the edge.
    pub edge: usize,
    /// Number of the line.
    pub line: usize,
    /// Squared Mahalanobis distance, two degrees of freedom.
    pub distance_squared: f64,
}

/// What may be paired.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssociationRule {
    /// Largest squared distance.
    pub gate: f64,
    /// An edge (or line) whose two best candidates differ by less is not paired at all.
    pub ambiguity: f64,
}

/// 99 % of the chi-square distribution with two degrees of freedom.
pub const GATE: f64 = 9.210_340_371_976_184;

impl Default for AssociationRule {
    fn default() -> Self {
        Self { gate: GATE, ambiguity: 2.0 }
    }
}

/// Pairs edges and lines; keeps its buffers.
#[derive(Clone, Debug, Default)]
pub struct Association {
    best_of_edge: Vec<Best>,
    best_of_line: Vec<Best>,
    order: Vec<Candidate>,
    pairs: Vec<Candidate>,
}

/// The two smallest squared distances.
#[derive(Clone, Copy, Debug)]
struct Best {
    first: f64,
    second: f64,
    is_paired: bool,
}

impl Best {
    const NONE: Self = Self { first: f64::INFINITY, second: f64::INFINITY, is_paired: false };

    fn take(&mut self, distance: f64) {
        if distance < self.first {
            (self.first, self.second) = (distance, self.first);
        } else {
            self.second = self.second.min(distance);
        }
    }

    fn is_ambiguous(&self, least: f64) -> bool {
        self.second.is_finite() && self.second - self.first < least
    }
}

impl Association {
    /// The pairs among the candidates, by ascending distance (then edge, then line): greedy, one to one, within the gate,
    /// without edges and lines that are ambiguous.
    pub fn pair(&mut self, candidates: &[Candidate], rule: &AssociationRule) -> &[Candidate] {
        let within = || candidates.iter().filter(|candidate| candidate.distance_squared <= rule.gate);
        let count = |number: fn(&Candidate) -> usize| within().map(number).max().map_or(0, |most| most + 1);
        self.best_of_edge.clear();
        self.best_of_edge.resize(count(|candidate| candidate.edge), Best::NONE);
        self.best_of_line.clear();
        self.best_of_line.resize(count(|candidate| candidate.line), Best::NONE);
        self.order.clear();
        self.pairs.clear();
        for candidate in within() {
            self.best_of_edge[candidate.edge].take(candidate.distance_squared);
            self.best_of_line[candidate.line].take(candidate.distance_squared);
            self.order.push(*candidate);
        }
        self.order.sort_unstable_by(|a, b| {
            let by_number = (a.edge, a.line).cmp(&(b.edge, b.line));
            a.distance_squared.total_cmp(&b.distance_squared).then(by_number)
        });
        for candidate in &self.order {
            let (edge, line) =
                (&mut self.best_of_edge[candidate.edge], &mut self.best_of_line[candidate.line]);
            let is_taken = edge.is_paired || line.is_paired;
            if is_taken || edge.is_ambiguous(rule.ambiguity) || line.is_ambiguous(rule.ambiguity) {
                continue;
            }
            edge.is_paired = true;
            line.is_paired = true;
            self.pairs.push(*candidate);
        }
        &self.pairs
    }

    /// The edges that were ambiguous, ascending.
    pub fn ambiguous_edges(&self, rule: &AssociationRule) -> impl Iterator<Item = usize> {
        ambiguous(&self.best_of_edge, rule.ambiguity)
    }

    /// The lines that were ambiguous, ascending.
    pub fn ambiguous_lines(&self, rule: &AssociationRule) -> impl Iterator<Item = usize> {
        ambiguous(&self.best_of_line, rule.ambiguity)
    }
}

fn ambiguous(best: &[Best], least: f64) -> impl Iterator<Item = usize> {
    best.iter().enumerate().filter(move |(_, best)| best.is_ambiguous(least)).map(|(number, _)| number)
}
