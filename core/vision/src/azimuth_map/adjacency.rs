use std::f64::consts::TAU;

/// Pair of edges observed next to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Neighbors {
    /// Number of the right edge, as seen from the robot.
    pub right: u32,
    /// Number of the left edge.
    pub left: u32,
    /// Number of frames in which they were adjacent.
    pub frames: u32,
    /// True if a frame has shown both with another edge between them: no surface connects them.
    pub is_broken: bool,
}

/// Adjacency of edges, in their order around the robot.
///
/// Yagi et al. (1995), section IV.
#[derive(Clone, Debug, Default)]
pub struct AdjacencyTable {
    rows: Vec<u32>,
    /// Sorted by right and left number.
    pairs: Vec<Neighbors>,
    order: Vec<(f64, u32)>,
    /// Index of each edge in `order`.
    ranks: Vec<Option<u32>>,
}

impl AdjacencyTable {
    /// Updates the table with the edges of one frame: their numbers (small, each once) and bearings, rad. Ignores
    /// bearings that are not finite.
    pub fn update(&mut self, seen: impl IntoIterator<Item = (u32, f64)>) {
        self.order.clear();
        let numbers = seen.into_iter().filter(|(_, bearing)| bearing.is_finite());
        self.order.extend(numbers.map(|(number, bearing)| (bearing.rem_euclid(TAU), number)));
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.ranks.fill(None);
        for (rank, &(_, number)) in self.order.iter().enumerate() {
            let number = number as usize;
            if number >= self.ranks.len() {
                self.ranks.resize(number + 1, None);
            }
            self.ranks[number] = Some(rank as u32);
        }
        self.insert_rows();
        self.break_pairs();
        self.count_pairs();
    }

    /// Numbers of all edges, in order around the robot.
    #[must_use]
    pub fn rows(&self) -> &[u32] {
        &self.rows
    }

    /// All pairs that were adjacent, sorted by right and left number.
    #[must_use]
    pub fn pairs(&self) -> &[Neighbors] {
        &self.pairs
    }

    /// Pair of a right and a left edge; `None` if they were never adjacent.
    #[must_use]
    pub fn pair(&self, right: u32, left: u32) -> Option<&Neighbors> {
        self.find(right, left).ok().map(|index| &self.pairs[index])
    }

    /// Returns true if a frame has shown another edge between two edges that were adjacent.
    #[must_use]
    pub fn is_broken(&self, a: u32, b: u32) -> bool {
        [self.pair(a, b), self.pair(b, a)].into_iter().flatten().any(|pair| pair.is_broken)
    }

    /// Removes an edge.
    pub fn remove(&mut self, number: u32) {
        self.rows.retain(|row| *row != number);
        self.pairs.retain(|pair| pair.right != number && pair.left != number);
    }

    fn insert_rows(&mut self) {
        if self.rows.is_empty() {
            self.rows.extend(self.order.iter().map(|(_, number)| number));
            return;
        }
        let count = self.order.len();
        for rank in 0..count {
            let number = self.order[rank].1;
            if self.rows.contains(&number) {
                continue;
            }
            let mut behind = (1..count).map(|step| self.order[(rank + step) % count].1);
            let row = behind.find_map(|next| self.rows.iter().position(|row| *row == next));
            self.rows.insert(row.unwrap_or(self.rows.len()), number);
        }
    }

    fn break_pairs(&mut self) {
        let count = self.order.len() as u32;
        let rank = |number: u32| self.ranks.get(number as usize).copied().flatten();
        for pair in &mut self.pairs {
            if let (Some(right), Some(left)) = (rank(pair.right), rank(pair.left)) {
                pair.is_broken |= (right + 1) % count != left;
            }
        }
    }

    fn count_pairs(&mut self) {
        let count = self.order.len();
        if count < 2 {
            return;
        }
        for rank in 0..count {
            let (right, left) = (self.order[rank].1, self.order[(rank + 1) % count].1);
            match self.find(right, left) {
                Ok(index) => self.pairs[index].frames += 1,
                Err(index) => {
                    self.pairs.insert(index, Neighbors { right, left, frames: 1, is_broken: false });
                }
            }
        }
    }

    fn find(&self, right: u32, left: u32) -> Result<usize, usize> {
        self.pairs.binary_search_by(|pair| (pair.right, pair.left).cmp(&(right, left)))
    }
}
