use nalgebra::{DMatrix, DVector, Matrix2, Point2, Vector2};
use thiserror::Error;

use yamabico_geometry::{Pose2, angle_difference, wrap_angle};

/// An edge seen from a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingObservation {
    /// Number of the place.
    pub place: usize,
    /// Number of the edge.
    pub edge: usize,
    /// In the camera's frame, radians.
    pub azimuth_rad: f64,
    /// Its standard deviation, radians, > 0.
    pub sigma_rad: f64,
}

/// How uncertain the way between two places is, and the camera on its mast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WayRule {
    /// Standard deviation of a way, however short, meters, > 0.
    pub still_m: f64,
    /// ... and after a meter; it grows with the way.
    pub way_per_way_m: f64,
    /// Standard deviation of a turn, however small, radians, > 0.
    pub still_rad: f64,
    /// ... and after a radian.
    pub turn_per_turn_rad: f64,
    /// ... and after a meter, radians.
    pub turn_per_way_rad: f64,
    /// Standard deviation of the camera's sway about the vertical, radians, > 0.
    pub sway_rad: f64,
    /// Residuals of azimuths beyond so many standard deviations count less.
    pub huber: f64,
}

impl Default for WayRule {
    fn default() -> Self {
        Self {
            still_m: 0.0005,
            way_per_way_m: 0.02,
            still_rad: 0.0005,
            turn_per_turn_rad: 0.02,
            turn_per_way_rad: 0.02,
            sway_rad: 1e-3,
            huber: 2.0,
        }
    }
}

/// Why nothing was adjusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum AdjustmentError {
    /// Fewer than two places, no edges, or a number that is none.
    #[error("two places and an edge are needed, with finite numbers")]
    TooFew,
    /// An edge or a place hangs by nothing.
    #[error("what was seen does not fix every edge")]
    Singular,
}

/// Places and edges that fit best to what was seen and driven, together.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjusted {
    /// The robot's poses, map frame; the first one stays where it was.
    pub places: Vec<Pose2>,
    /// The edges, meters.
    pub edges: Vec<Point2<f64>>,
    /// Covariances of the edges, square meters.
    pub covariances: Vec<Matrix2<f64>>,
    /// Root mean square of the residuals of each edge's azimuths, in standard deviations.
    pub misfits: Vec<f64>,
}

/// Steps of the fit, at most.
const MAX_STEPS: usize = 15;
/// The fit has settled when no number changes by more.
const SETTLED: f64 = 1e-7;
/// Azimuths that miss by more standard deviations than this are of something else.
const WILD: f64 = 8.0;
/// Unknowns of a place: x, y, heading, sway.
const OF_PLACE: usize = 4;
/// The first place stays where it is to this standard deviation, meters and radians.
const FIXED: f64 = 1e-6;

/// Fits all places and edges at once to the azimuths, the ways driven between successive places (`odometry`, in any frame) and the
/// sway that is small on average: Gauss-Newton from `odometry` and `edges`, with Huber's weights.
///
/// # Errors
/// [`AdjustmentError`].
pub fn adjust(
    odometry: &[Pose2],
    edges: &[Point2<f64>],
    seen: &[BearingObservation],
    rule: &WayRule,
) -> Result<Adjusted, AdjustmentError> {
    let is_finite = odometry.iter().all(Pose2::is_finite)
        && edges.iter().all(|edge| edge.coords.iter().all(|value| value.is_finite()))
        && seen.iter().all(|one| {
            one.azimuth_rad.is_finite()
                && one.sigma_rad > 0.0
                && one.place < odometry.len()
                && one.edge < edges.len()
        });
    if odometry.len() < 2 || edges.is_empty() || !is_finite {
        return Err(AdjustmentError::TooFew);
    }
    let mut state =
        State { places: odometry.to_vec(), sway: vec![0.0; odometry.len()], edges: edges.to_vec() };
    state.settle(odometry, seen, rule)?;
    // What is no measurement of this edge is known once the rest fits.
    let fits = |one: &&BearingObservation| state.residual(one).abs() <= WILD * one.sigma_rad;
    let kept: Vec<_> = seen.iter().filter(fits).copied().collect();
    let normal = state.settle(odometry, &kept, rule)?;
    let inverse = normal.cholesky().ok_or(AdjustmentError::Singular)?.inverse();
    let mut sums = vec![(0.0, 0.0); edges.len()];
    for one in &kept {
        sums[one.edge].0 += (state.residual(one) / one.sigma_rad).powi(2);
        sums[one.edge].1 += 1.0;
    }
    let covariance =
        |edge: usize| inverse.fixed_view::<2, 2>(state.at_edge(edge), state.at_edge(edge)).into();
    Ok(Adjusted {
        covariances: (0..edges.len()).map(covariance).collect(),
        misfits: sums.iter().map(|(squares, count): &(f64, f64)| (squares / count.max(1.0)).sqrt()).collect(),
        places: state.places,
        edges: state.edges,
    })
}

struct State {
    places: Vec<Pose2>,
    sway: Vec<f64>,
    edges: Vec<Point2<f64>>,
}

impl State {
    fn at_edge(&self, edge: usize) -> usize {
        OF_PLACE * self.places.len() + 2 * edge
    }

    /// What was seen less what should have been, radians.
    fn residual(&self, one: &BearingObservation) -> f64 {
        let (place, away) =
            (&self.places[one.place], self.edges[one.edge] - self.places[one.place].position());
        angle_difference(one.azimuth_rad + self.sway[one.place] + place.theta, away.y.atan2(away.x))
    }

    fn shift(&mut self, step: &DVector<f64>) {
        for (i, (place, sway)) in self.places.iter_mut().zip(&mut self.sway).enumerate() {
            let at = OF_PLACE * i;
            place.x += step[at];
            place.y += step[at + 1];
            place.theta = wrap_angle(place.theta + step[at + 2]);
            *sway += step[at + 3];
        }
        let first = OF_PLACE * self.places.len();
        for (i, edge) in self.edges.iter_mut().enumerate() {
            *edge += Vector2::new(step[first + 2 * i], step[first + 2 * i + 1]);
        }
    }

    /// Fits, and returns the matrix of the last equations.
    fn settle(
        &mut self,
        odometry: &[Pose2],
        seen: &[BearingObservation],
        rule: &WayRule,
    ) -> Result<DMatrix<f64>, AdjustmentError> {
        for _ in 0..MAX_STEPS {
            let (normal, right) = self.equations(odometry, seen, rule);
            let step = normal.cholesky().ok_or(AdjustmentError::Singular)?.solve(&right);
            self.shift(&step);
            if step.amax() < SETTLED {
                break;
            }
        }
        Ok(self.equations(odometry, seen, rule).0)
    }

    fn equations(
        &self,
        odometry: &[Pose2],
        seen: &[BearingObservation],
        rule: &WayRule,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let mut sums = Sums::new(self.at_edge(self.edges.len()));
        for k in 0..3 {
            sums.add(&[(k, 1.0)], 0.0, FIXED);
        }
        for place in 0..self.places.len() {
            sums.add(&[(OF_PLACE * place + 3, 1.0)], -self.sway[place], rule.sway_rad);
        }
        for one in seen {
            let residual = self.residual(one);
            let away = self.edges[one.edge] - self.places[one.place].position();
            let squared = away.norm_squared().max(f64::MIN_POSITIVE);
            let across = Vector2::new(-away.y, away.x) / squared;
            let (place, edge) = (OF_PLACE * one.place, self.at_edge(one.edge));
            let far = (residual.abs() / (rule.huber * one.sigma_rad)).max(1.0);
            // The azimuth that should be seen, by each unknown.
            let row = [
                (place, -across.x),
                (place + 1, -across.y),
                (place + 2, -1.0),
                (place + 3, -1.0),
                (edge, across.x),
                (edge + 1, across.y),
            ];
            sums.add(&row, residual, one.sigma_rad * far.sqrt());
        }
        for (i, pair) in odometry.windows(2).enumerate() {
            self.add_way(&mut sums, i, &pair[0].relative(&pair[1]), rule);
        }
        (sums.normal, sums.right)
    }

    /// The way from place `i` to the next one, as the odometry tells it.
    fn add_way(&self, sums: &mut Sums, i: usize, driven: &Pose2, rule: &WayRule) {
        let (from, to) = (&self.places[i], &self.places[i + 1]);
        let is = from.relative(to);
        let way = driven.x.hypot(driven.y);
        let sigma_m = rule.still_m.hypot(rule.way_per_way_m * way);
        let turn = (rule.turn_per_turn_rad * driven.theta).hypot(rule.turn_per_way_rad * way);
        let sigma_rad = rule.still_rad.hypot(turn);
        let (sin, cos) = from.theta.sin_cos();
        let (a, b) = (OF_PLACE * i, OF_PLACE * (i + 1));
        let along = [(a, -cos), (a + 1, -sin), (b, cos), (b + 1, sin), (a + 2, is.y)];
        let aside = [(a, sin), (a + 1, -cos), (b, -sin), (b + 1, cos), (a + 2, -is.x)];
        sums.add(&along, driven.x - is.x, sigma_m);
        sums.add(&aside, driven.y - is.y, sigma_m);
        sums.add(&[(a + 2, -1.0), (b + 2, 1.0)], angle_difference(driven.theta, is.theta), sigma_rad);
    }
}

/// The normal equations.
struct Sums {
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

impl Sums {
    fn new(unknowns: usize) -> Self {
        Self { normal: DMatrix::zeros(unknowns, unknowns), right: DVector::zeros(unknowns) }
    }

    /// A measurement that is `residual` larger than it should be, with the derivatives of what it should be.
    fn add(&mut self, row: &[(usize, f64)], residual: f64, sigma: f64) {
        let weight = 1.0 / (sigma * sigma);
        for &(i, a) in row {
            self.right[i] += weight * a * residual;
            for &(j, b) in row {
                self.normal[(i, j)] += weight * a * b;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edges() -> Vec<Point2<f64>> {
        [(1.2, 0.3), (1.0, 1.4), (-0.4, 1.3), (-1.1, -0.2), (0.2, -1.2), (1.3, -0.9)]
            .map(|(x, y)| Point2::new(x, y))
            .to_vec()
    }

    fn places() -> Vec<Pose2> {
        let mut at = Pose2::new(-0.6, -0.4, 0.2);
        (0..25)
            .map(|i| {
                let here = at;
                at = at.compose(&Pose2::new(0.05, 0.0, if i > 9 { 0.08 } else { 0.0 }));
                here
            })
            .collect()
    }

    fn look(places: &[Pose2], sway: impl Fn(usize) -> f64) -> Vec<BearingObservation> {
        let mut seen = Vec::new();
        for (place, pose) in places.iter().enumerate() {
            for (edge, position) in edges().into_iter().enumerate() {
                let away = position - pose.position();
                let azimuth_rad = wrap_angle(away.y.atan2(away.x) - pose.theta - sway(place));
                seen.push(BearingObservation { place, edge, azimuth_rad, sigma_rad: 0.002 });
            }
        }
        seen
    }

    fn off(edges: &[Point2<f64>]) -> Vec<Point2<f64>> {
        edges.iter().enumerate().map(|(i, e)| e + Vector2::new(0.04 * (i as f64).sin(), 0.03)).collect()
    }

    #[test]
    fn sway_and_slip_are_told_from_the_edges() {
        let truth = places();
        let sway = |place: usize| 0.02 * (2.3 * place as f64).sin();
        let seen = look(&truth, sway);
        // Wheels that slip: each way a little off.
        let mut at = truth[0];
        let mut odometry = vec![at];
        for (i, pair) in truth.windows(2).enumerate() {
            let way = pair[0].relative(&pair[1]);
            let slip = 0.0008 * (1.7 * i as f64).sin();
            at = at.compose(&Pose2::new(way.x + slip, way.y, way.theta + 2.0 * slip));
            odometry.push(at);
        }
        let rule = WayRule { sway_rad: 0.02, ..WayRule::default() };
        let adjusted = adjust(&odometry, &off(&edges()), &seen, &rule).unwrap();
        for (edge, found) in edges().iter().zip(&adjusted.edges) {
            assert!((edge - found).norm() < 0.01, "{edge} {found}");
        }
        let end = |places: &[Pose2]| places[24].distance(&truth[24]);
        assert!(end(&adjusted.places) <= end(&odometry).max(0.005));
        assert!(adjusted.covariances.iter().all(|c| c.trace().sqrt() < 0.05 && c.determinant() > 0.0));
    }

    #[test]
    fn what_is_exact_stays_and_what_is_wrong_counts_less() {
        let truth = places();
        let mut seen = look(&truth, |_| 0.0);
        seen[31].azimuth_rad += 0.3;
        let adjusted = adjust(&truth, &off(&edges()), &seen, &WayRule::default()).unwrap();
        for (edge, found) in edges().iter().zip(&adjusted.edges) {
            assert!((edge - found).norm() < 2e-3, "{edge} {found}");
        }
        let exact = adjust(&truth, &off(&edges()), &look(&truth, |_| 0.0), &WayRule::default()).unwrap();
        for (edge, found) in edges().iter().zip(&exact.edges) {
            assert!((edge - found).norm() < 1e-7, "{edge} {found}");
        }
        assert!(exact.misfits.iter().all(|misfit| *misfit < 1e-4));
        assert!(adjusted.misfits.iter().all(|misfit| *misfit < 1.0));
    }

    #[test]
    fn what_cannot_be_adjusted_is_named() {
        let truth = places();
        let rule = WayRule::default();
        assert_eq!(adjust(&truth[..1], &edges(), &[], &rule), Err(AdjustmentError::TooFew));
        assert_eq!(adjust(&truth, &edges(), &[], &rule), Err(AdjustmentError::Singular));
        let broken = vec![Point2::new(f64::NAN, 0.0)];
        assert_eq!(adjust(&truth, &broken, &[], &rule), Err(AdjustmentError::TooFew));
    }
}
