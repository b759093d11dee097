use nalgebra::{DMatrix, DVector, Matrix2, Point2, Vector2};
use thiserror::Error;

use yamabico_geometry::{Hypotenuse, Pose2, angle_difference, wrap_angle};

/// Azimuth of an edge measured from one pose, for the joint adjustment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingObservation {
    /// Index of the pose.
    pub pose: usize,
    /// Index of the edge.
    pub edge: usize,
    /// Azimuth in the camera frame, rad.
    pub azimuth_rad: f64,
    /// Standard deviation of the azimuth, rad, > 0.
    pub sigma_rad: f64,
}

/// Noise model of the odometry between two poses, of the mast's sway, and of outliers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdjustmentRule {
    /// Minimum standard deviation of a translation, m, > 0.
    pub min_translation_sigma_m: f64,
    /// Standard deviation of a translation per distance traveled, m/m.
    pub translation_sigma_per_m: f64,
    /// Minimum standard deviation of a rotation, rad, > 0.
    pub min_rotation_sigma_rad: f64,
    /// Standard deviation of a rotation per rotation, rad/rad.
    pub rotation_sigma_per_rad: f64,
    /// Standard deviation of a rotation per distance traveled, rad/m.
    pub rotation_sigma_per_m_rad: f64,
    /// Standard deviation of the camera's sway about the vertical axis, rad, > 0.
    pub sway_sigma_rad: f64,
    /// Huber threshold of azimuth residuals, standard deviations.
    pub huber_sigmas: f64,
}

impl Default for AdjustmentRule {
    fn default() -> Self {
        Self {
            min_translation_sigma_m: 0.0005,
            translation_sigma_per_m: 0.02,
            min_rotation_sigma_rad: 0.0005,
            rotation_sigma_per_rad: 0.02,
            rotation_sigma_per_m_rad: 0.02,
            sway_sigma_rad: 1e-3,
            huber_sigmas: 2.0,
        }
    }
}

/// Reason why the adjustment failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum AdjustmentError {
    /// Fewer than two poses, no edges, an index out of range, or a value that is not finite.
    #[error("at least two poses and one edge with finite values are required")]
    TooFew,
    /// The normal equations are singular: the observations do not determine every pose and edge.
    #[error("the observations do not determine every pose and edge")]
    Singular,
}

/// Result of the joint adjustment of poses and edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjusted {
    /// Poses of the robot, map frame. The first observation is fixed.
    pub poses: Vec<Pose2>,
    /// Positions of the edges, map frame, m.
    pub edges: Vec<Point2<f64>>,
    /// Covariances of the edges, m^2.
    pub covariances: Vec<Matrix2<f64>>,
    /// Root mean square of each edge's azimuth residuals, in standard deviations.
    pub misfits: Vec<f64>,
}

/// Maximum number of Gauss-Newton steps.
const MAX_STEPS: usize = 15;
/// Largest component of a step at which the iteration has converged.
const CONVERGED_STEP: f64 = 1e-7;
/// Residual above which an azimuth is an outlier, standard deviations.
const OUTLIER_SIGMAS: f64 = 8.0;
/// Number of unknowns per pose: x, y, heading, sway.
const UNKNOWNS_PER_POSE: usize = 4;
/// Standard deviation that fixes the first pose, m and rad.
const FIXED_SIGMA: f64 = 1e-6;

/// Adjusts all poses and edges jointly to the azimuths, to the odometry between successive poses (in any frame) and to
/// a zero-mean sway: Gauss-Newton with Huber weights, starting from `odometry` and `edges`.
///
/// # Errors
/// [`AdjustmentError`].
pub fn adjust(
    odometry: &[Pose2],
    edges: &[Point2<f64>],
    seen: &[BearingObservation],
    rule: &AdjustmentRule,
) -> Result<Adjusted, AdjustmentError> {
    let is_finite = odometry.iter().all(Pose2::is_finite)
        && edges.iter().all(|edge| edge.coords.iter().all(|value| value.is_finite()))
        && seen.iter().all(|observation| {
            observation.azimuth_rad.is_finite()
                && observation.sigma_rad > 0.0
                && observation.pose < odometry.len()
                && observation.edge < edges.len()
        });
    if odometry.len() < 2 || edges.is_empty() || !is_finite {
        return Err(AdjustmentError::TooFew);
    }
    let mut state =
        State { poses: odometry.to_vec(), sway: vec![0.0; odometry.len()], edges: edges.to_vec() };
    state.iterate(odometry, seen, rule)?;
    // Outliers can be identified once the rest fits.
    let fits = |observation: &&BearingObservation| {
        state.residual(observation).abs() <= OUTLIER_SIGMAS * observation.sigma_rad
    };
    let kept: Vec<_> = seen.iter().filter(fits).copied().collect();
    let normal = state.iterate(odometry, &kept, rule)?;
    let inverse = normal.cholesky().ok_or(AdjustmentError::Singular)?.inverse();
    let mut sums = vec![(0.0, 0.0); edges.len()];
    for observation in &kept {
        sums[observation.edge].0 += (state.residual(observation) / observation.sigma_rad).powi(2);
        sums[observation.edge].1 += 1.0;
    }
    let covariance =
        |edge: usize| inverse.fixed_view::<2, 2>(state.at_edge(edge), state.at_edge(edge)).into();
    Ok(Adjusted {
        covariances: (0..edges.len()).map(covariance).collect(),
        misfits: sums.iter().map(|(squares, count): &(f64, f64)| (squares / count.max(1.0)).sqrt()).collect(),
        poses: state.poses,
        edges: state.edges,
    })
}

struct State {
    poses: Vec<Pose2>,
    sway: Vec<f64>,
    edges: Vec<Point2<f64>>,
}

impl State {
    fn at_edge(&self, edge: usize) -> usize {
        UNKNOWNS_PER_POSE * self.poses.len() + 2 * edge
    }

    /// Observed minus predicted azimuth, rad.
    fn residual(&self, observation: &BearingObservation) -> f64 {
        let pose = &self.poses[observation.pose];
        let away = self.edges[observation.edge] - pose.position();
        angle_difference(
            observation.azimuth_rad + self.sway[observation.pose] + pose.theta,
            away.y.atan2(away.x),
        )
    }

    fn shift(&mut self, step: &DVector<f64>) {
        for (i, (pose, sway)) in self.poses.iter_mut().zip(&mut self.sway).enumerate() {
            let at = UNKNOWNS_PER_POSE * i;
            pose.x += step[at];
            pose.y += step[at + 1];
            pose.theta = wrap_angle(pose.theta + step[at + 2]);
            *sway += step[at + 3];
        }
        let first = UNKNOWNS_PER_POSE * self.poses.len();
        for (i, edge) in self.edges.iter_mut().enumerate() {
            *edge += Vector2::new(step[first + 2 * i], step[first + 2 * i + 1]);
        }
    }

    /// Iterates to convergence and returns the final normal matrix.
    fn iterate(
        &mut self,
        odometry: &[Pose2],
        seen: &[BearingObservation],
        rule: &AdjustmentRule,
    ) -> Result<DMatrix<f64>, AdjustmentError> {
        for _ in 0..MAX_STEPS {
            let (normal, right) = self.equations(odometry, seen, rule);
            let step = normal.cholesky().ok_or(AdjustmentError::Singular)?.solve(&right);
            self.shift(&step);
            if step.amax() < CONVERGED_STEP {
                break;
            }
        }
        Ok(self.equations(odometry, seen, rule).0)
    }

    fn equations(
        &self,
        odometry: &[Pose2],
        seen: &[BearingObservation],
        rule: &AdjustmentRule,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let mut sums = Sums::new(self.at_edge(self.edges.len()));
        for k in 0..3 {
            sums.add(&[(k, 1.0)], 0.0, FIXED_SIGMA);
        }
        for pose in 0..self.poses.len() {
            sums.add(&[(UNKNOWNS_PER_POSE * pose + 3, 1.0)], -self.sway[pose], rule.sway_sigma_rad);
        }
        for observation in seen {
            let residual = self.residual(observation);
            let away = self.edges[observation.edge] - self.poses[observation.pose].position();
            let squared = away.norm_squared().max(f64::MIN_POSITIVE);
            let across = Vector2::new(-away.y, away.x) / squared;
            let (pose, edge) = (UNKNOWNS_PER_POSE * observation.pose, self.at_edge(observation.edge));
            let far = (residual.abs() / (rule.huber_sigmas * observation.sigma_rad)).max(1.0);
            // Derivatives of the predicted azimuth with respect to each unknown.
            let row = [
                (pose, -across.x),
                (pose + 1, -across.y),
                (pose + 2, -1.0),
                (pose + 3, -1.0),
                (edge, across.x),
                (edge + 1, across.y),
            ];
            sums.add(&row, residual, observation.sigma_rad * far.sqrt());
        }
        for (i, pair) in odometry.windows(2).enumerate() {
            self.add_odometry(&mut sums, i, &pair[0].relative(&pair[1]), rule);
        }
        (sums.normal, sums.right)
    }

    /// Adds the odometry measurement from pose `i` to the next observation.
    fn add_odometry(&self, sums: &mut Sums, i: usize, driven: &Pose2, rule: &AdjustmentRule) {
        let (from, to) = (&self.poses[i], &self.poses[i + 1]);
        let predicted = from.relative(to);
        let distance_m = driven.x.hypotenuse(driven.y);
        let sigma_m = rule.min_translation_sigma_m.hypotenuse(rule.translation_sigma_per_m * distance_m);
        let turn = (rule.rotation_sigma_per_rad * driven.theta)
            .hypotenuse(rule.rotation_sigma_per_m_rad * distance_m);
        let sigma_rad = rule.min_rotation_sigma_rad.hypotenuse(turn);
        let (sin, cos) = from.theta.sin_cos();
        let (a, b) = (UNKNOWNS_PER_POSE * i, UNKNOWNS_PER_POSE * (i + 1));
        let along = [(a, -cos), (a + 1, -sin), (b, cos), (b + 1, sin), (a + 2, predicted.y)];
        let sideways = [(a, sin), (a + 1, -cos), (b, -sin), (b + 1, cos), (a + 2, -predicted.x)];
        sums.add(&along, driven.x - predicted.x, sigma_m);
        sums.add(&sideways, driven.y - predicted.y, sigma_m);
        sums.add(&[(a + 2, -1.0), (b + 2, 1.0)], angle_difference(driven.theta, predicted.theta), sigma_rad);
    }
}

/// Normal equations.
struct Sums {
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

impl Sums {
    fn new(unknowns: usize) -> Self {
        Self { normal: DMatrix::zeros(unknowns, unknowns), right: DVector::zeros(unknowns) }
    }

    /// Adds a measurement with this residual (observed minus predicted) and the derivatives of the predicted value.
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

    fn poses() -> Vec<Pose2> {
        let mut at = Pose2::new(-0.6, -0.4, 0.2);
        (0..25)
            .map(|i| {
                let here = at;
                at = at.compose(&Pose2::new(0.05, 0.0, if i > 9 { 0.08 } else { 0.0 }));
                here
            })
            .collect()
    }

    fn look(poses: &[Pose2], sway: impl Fn(usize) -> f64) -> Vec<BearingObservation> {
        let mut seen = Vec::new();
        for (index, pose) in poses.iter().enumerate() {
            for (edge, position) in edges().into_iter().enumerate() {
                let away = position - pose.position();
                let azimuth_rad = wrap_angle(away.y.atan2(away.x) - pose.theta - sway(index));
                seen.push(BearingObservation { pose: index, edge, azimuth_rad, sigma_rad: 0.002 });
            }
        }
        seen
    }

    fn off(edges: &[Point2<f64>]) -> Vec<Point2<f64>> {
        edges.iter().enumerate().map(|(i, e)| e + Vector2::new(0.04 * (i as f64).sin(), 0.03)).collect()
    }

    #[test]
    fn sway_and_slip_are_separated_from_the_edges() {
        let truth = poses();
        let sway = |pose: usize| 0.02 * (2.3 * pose as f64).sin();
        let seen = look(&truth, sway);
        // Wheel slip: each translation is slightly off.
        let mut at = truth[0];
        let mut odometry = vec![at];
        for (i, pair) in truth.windows(2).enumerate() {
            let motion = pair[0].relative(&pair[1]);
            let slip = 0.0008 * (1.7 * i as f64).sin();
            at = at.compose(&Pose2::new(motion.x + slip, motion.y, motion.theta + 2.0 * slip));
            odometry.push(at);
        }
        let rule = AdjustmentRule { sway_sigma_rad: 0.02, ..AdjustmentRule::default() };
        let adjusted = adjust(&odometry, &off(&edges()), &seen, &rule).unwrap();
        for (edge, found) in edges().iter().zip(&adjusted.edges) {
            assert!((edge - found).norm() < 0.01, "{edge} {found}");
        }
        let end = |poses: &[Pose2]| poses[24].distance(&truth[24]);
        assert!(end(&adjusted.poses) <= end(&odometry).max(0.005));
        assert!(adjusted.covariances.iter().all(|c| c.trace().sqrt() < 0.05 && c.determinant() > 0.0));
    }

    #[test]
    fn exact_data_is_unchanged_and_outliers_are_rejected() {
        let truth = poses();
        let mut seen = look(&truth, |_| 0.0);
        seen[31].azimuth_rad += 0.3;
        let adjusted = adjust(&truth, &off(&edges()), &seen, &AdjustmentRule::default()).unwrap();
        for (edge, found) in edges().iter().zip(&adjusted.edges) {
            assert!((edge - found).norm() < 2e-3, "{edge} {found}");
        }
        let exact =
            adjust(&truth, &off(&edges()), &look(&truth, |_| 0.0), &AdjustmentRule::default()).unwrap();
        for (edge, found) in edges().iter().zip(&exact.edges) {
            assert!((edge - found).norm() < 1e-7, "{edge} {found}");
        }
        assert!(exact.misfits.iter().all(|misfit| *misfit < 1e-4));
        assert!(adjusted.misfits.iter().all(|misfit| *misfit < 1.0));
    }

    #[test]
    fn insufficient_data_is_rejected() {
        let truth = poses();
        let rule = AdjustmentRule::default();
        assert_eq!(adjust(&truth[..1], &edges(), &[], &rule), Err(AdjustmentError::TooFew));
        assert_eq!(adjust(&truth, &edges(), &[], &rule), Err(AdjustmentError::Singular));
        let broken = vec![Point2::new(f64::NAN, 0.0)];
        assert_eq!(adjust(&truth, &broken, &[], &rule), Err(AdjustmentError::TooFew));
    }
}
