//! One-to-one association of image lines with map edges, without ambiguous pairs.

/// Possible pair of a map edge and an image line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Index of the edge.
    pub edge: usize,
    /// Index of the line.
    pub line: usize,
    /// Squared Mahalanobis distance, two degrees of freedom.
    pub distance_squared: f64,
}

/// Limits of the association.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssociationRule {
    /// Maximum squared Mahalanobis distance.
    pub gate: f64,
    /// Difference of the squared distances of an edge's (or line's) two best candidates below which it stays unpaired.
    pub ambiguity: f64,
}

/// 99 % quantile of the chi-squared distribution with two degrees of freedom.
pub const GATE_99: f64 = 9.210_340_371_976_184;

impl Default for AssociationRule {
    fn default() -> Self {
        Self { gate: GATE_99, ambiguity: 2.0 }
    }
}

/// Association of edges and lines. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Association {
    best_of_edge: Vec<Best>,
    best_of_line: Vec<Best>,
    order: Vec<Candidate>,
    pairs: Vec<Candidate>,
}

/// Two smallest squared distances.
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

    fn is_ambiguous(&self, min_difference: f64) -> bool {
        self.second.is_finite() && self.second - self.first < min_difference
    }
}

impl Association {
    /// Selects pairs among the candidates within the gate greedily by ascending distance (then edge, then line), one to
    /// one, except ambiguous edges and lines.
    pub fn pair(&mut self, candidates: &[Candidate], rule: &AssociationRule) -> &[Candidate] {
        let within = || candidates.iter().filter(|candidate| candidate.distance_squared <= rule.gate);
        let count = |number: fn(&Candidate) -> usize| within().map(number).max().map_or(0, |max| max + 1);
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

    /// Returns the ambiguous edges, ascending.
    pub fn ambiguous_edges(&self, rule: &AssociationRule) -> impl Iterator<Item = usize> {
        ambiguous(&self.best_of_edge, rule.ambiguity)
    }

    /// Returns the ambiguous lines, ascending.
    pub fn ambiguous_lines(&self, rule: &AssociationRule) -> impl Iterator<Item = usize> {
        ambiguous(&self.best_of_line, rule.ambiguity)
    }
}

fn ambiguous(best: &[Best], min_difference: f64) -> impl Iterator<Item = usize> {
    best.iter().enumerate().filter(move |(_, best)| best.is_ambiguous(min_difference)).map(|(index, _)| index)
}
