//! Links edge points into chains that run along the edge with the brighter side on one hand.

use super::edges::{EdgePoint, EdgePoints};

const NONE: u32 = u32::MAX;

/// Which chains are kept.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainRule {
    /// Neighbours whose gradients differ by more are not linked: squared cosine of the angle.
    pub squared_cosine: f32,
    /// A chain needs a point with at least this squared gradient.
    pub squared_seed: f32,
    /// A chain needs at least so many points.
    pub least_points: usize,
}

/// The chains of one image, one after the other, with the buffers that link them.
#[derive(Clone, Debug, Default)]
pub(super) struct Chains {
    /// Points of all kept chains, in the order along each.
    pub points: Vec<EdgePoint>,
    /// Index behind the last point of each chain.
    pub ends: Vec<u32>,
    links: Vec<Link>,
    row_above: Vec<u32>,
    row_here: Vec<u32>,
}

/// The nearest point ahead and behind; ahead is where the brighter side is on the left in a picture with v downwards.
#[derive(Clone, Copy, Debug)]
struct Link {
    ahead: u32,
    behind: u32,
    ahead_distance: f32,
    behind_distance: f32,
}

const UNLINKED: Link =
    Link { ahead: NONE, behind: NONE, ahead_distance: f32::INFINITY, behind_distance: f32::INFINITY };

impl Chains {
    /// Links the points of an image `width` pixels wide.
    pub(super) fn link(&mut self, edges: &EdgePoints, width: usize, rule: ChainRule) {
        self.points.clear();
        self.ends.clear();
        self.links.clear();
        self.links.resize(edges.points.len(), UNLINKED);
        for row in [&mut self.row_above, &mut self.row_here] {
            row.clear();
            row.resize(width + 2, NONE);
        }
        self.link_neighbours(edges, rule.squared_cosine);
        self.walk(&edges.points, rule);
    }

    fn link_neighbours(&mut self, edges: &EdgePoints, squared_cosine: f32) {
        let mut above = 0..0;
        for row in edges.row_starts.windows(2) {
            let here = row[0] as usize..row[1] as usize;
            for i in here.clone() {
                let u = usize::from(edges.columns[i]) + 1;
                for j in
                    [self.row_here[u - 1], self.row_above[u - 1], self.row_above[u], self.row_above[u + 1]]
                {
                    if j != NONE {
                        relate(&edges.points, &mut self.links, i, j as usize, squared_cosine);
                    }
                }
                self.row_here[u] = i as u32;
            }
            for i in above {
                self.row_above[usize::from(edges.columns[i]) + 1] = NONE;
            }
            std::mem::swap(&mut self.row_above, &mut self.row_here);
            above = here;
        }
    }

    /// Chains begin at points without a mutual link behind; what is left then are rings.
    fn walk(&mut self, points: &[EdgePoint], rule: ChainRule) {
        for ring in [false, true] {
            for start in 0..points.len() {
                let link = self.links[start];
                let has_behind =
                    link.behind != NONE && self.links[link.behind as usize].ahead == start as u32;
                if link.ahead != NONE && has_behind == ring {
                    self.follow(points, start, rule);
                }
            }
        }
    }

    /// Takes the chain from `start` to its end and unlinks its points.
    fn follow(&mut self, points: &[EdgePoint], start: usize, rule: ChainRule) {
        let begin = self.points.len();
        let mut strongest = 0.0_f32;
        let mut here = start;
        loop {
            self.points.push(points[here]);
            strongest = strongest.max(points[here].squared_gradient());
            let next = std::mem::replace(&mut self.links[here].ahead, NONE);
            if next == NONE || self.links[next as usize].behind != here as u32 {
                break;
            }
            here = next as usize;
        }
        if self.points.len() - begin < rule.least_points || strongest < rule.squared_seed {
            self.points.truncate(begin);
        } else {
            self.ends.push(self.points.len() as u32);
        }
    }
}

/// Links the neighbours `i` and `j` when their gradients agree and one lies ahead of the other; the nearest wins.
fn relate(points: &[EdgePoint], links: &mut [Link], i: usize, j: usize, squared_cosine: f32) {
    let (a, b) = (points[i], points[j]);
    let agreement = a.gx * b.gx + a.gy * b.gy;
    if agreement <= 0.0
        || agreement * agreement < squared_cosine * (a.squared_gradient() * b.squared_gradient())
    {
        return;
    }
    let (du, dv) = (b.u - a.u, b.v - a.v);
    let distance = du * du + dv * dv;
    // Sum of the gradients: its perpendicular is the direction of the edge between the two.
    let (gx, gy) = (a.gx + b.gx, a.gy + b.gy);
    let progress = gx * dv - gy * du;
    if progress * progress < 0.25 * distance * (gx * gx + gy * gy) {
        return;
    }
    let (first, second) = if progress > 0.0 { (i, j) } else { (j, i) };
    if distance < links[first].ahead_distance {
        links[first].ahead = second as u32;
        links[first].ahead_distance = distance;
    }
    if distance < links[second].behind_distance {
        links[second].behind = first as u32;
        links[second].behind_distance = distance;
    }
}
