//! Adjustment of a lens and the poses of all boards to all corners, by the method of Levenberg and Marquardt.
//!
//! The poses are eliminated from each step (Schur complement), so that the time grows linearly with the number of boards.

use nalgebra::{Isometry3, Matrix2x3, Point3, SMatrix, SVector, UnitQuaternion, Vector2, Vector3};
use yamabico_geometry::camera::{Distortion, Intrinsics, Pinhole};

/// Number of parameters of a lens: fx, fy, cx, cy, k1, k2, p1, p2, k3.
pub const PARAMETERS: usize = 9;
/// Maximum number of steps.
const MAX_STEPS: usize = 100;
/// Relative decrease of the cost below which the adjustment has converged.
const MIN_DECREASE: f64 = 1e-10;
/// Damping at the start, and above which no step decreases the cost.
const DAMPING: [f64; 2] = [1e-3, 1e9];

type Lens = SVector<f64, PARAMETERS>;
type LensMatrix = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Cross = SMatrix<f64, PARAMETERS, 6>;
type PoseVector = SVector<f64, 6>;
type PoseMatrix = SMatrix<f64, 6, 6>;

/// Corners of one board in one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardView {
    /// Corners on the board, m.
    pub on_board: Vec<Vector2<f64>>,
    /// The same corners in the picture, distorted pixels.
    pub in_picture: Vec<Vector2<f64>>,
    /// Pose: camera from board.
    pub pose: Isometry3<f64>,
}

/// Parameters of a lens that an adjustment changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FreeLens {
    /// None: only the poses of the boards are adjusted.
    Fixed,
    /// All but k3, which remains zero.
    WithoutK3,
    /// All.
    WithK3,
}

/// Result of an adjustment.
#[derive(Clone, Debug, PartialEq)]
pub struct AdjustedLens {
    /// Camera.
    pub pinhole: Pinhole,
    /// Standard deviations of fx, fy, cx, cy, k1, k2, p1, p2, k3; zero for parameters that are not free.
    pub sigmas: [f64; PARAMETERS],
    /// Root mean square of the distances between corners and their projections in each view, px.
    pub rms_px: Vec<f64>,
    /// Poses: camera from board.
    pub poses: Vec<Isometry3<f64>>,
    /// Sum of the squared distances, px^2.
    pub cost: f64,
}

/// Adjusts a lens, and the poses of the views, which must be near the solution. `None` if the views do not determine the free
/// parameters, or a board lies behind the camera.
#[must_use]
pub fn adjust(start: &Pinhole, views: &[BoardView], free: FreeLens) -> Option<AdjustedLens> {
    let mut lens = vector_of(start);
    let size = start.intrinsics().size();
    let mut poses: Vec<Isometry3<f64>> = views.iter().map(|view| view.pose).collect();
    let mut cost = cost_of(&lens, &poses, views)?;
    let mut damping = DAMPING[0];
    for _ in 0..MAX_STEPS {
        let system = System::of(&lens, &poses, views, free);
        let Some((step, pose_steps)) = system.solve(damping) else {
            damping *= 10.0;
            if damping > DAMPING[1] {
                return None;
            }
            continue;
        };
        let next_lens = lens + step;
        let next_poses: Vec<_> =
            poses.iter().zip(&pose_steps).map(|(pose, step)| moved(pose, step)).collect();
        match cost_of(&next_lens, &next_poses, views).filter(|next| *next <= cost) {
            Some(next) => {
                let decrease = (cost - next) / cost.max(f64::MIN_POSITIVE);
                (lens, poses, cost) = (next_lens, next_poses, next);
                damping = (0.1 * damping).max(1e-12);
                if decrease < MIN_DECREASE {
                    break;
                }
            }
            None => {
                damping *= 10.0;
                if damping > DAMPING[1] {
                    break;
                }
            }
        }
    }
    let corners: usize = views.iter().map(|view| view.in_picture.len()).sum();
    let unknowns = 6 * views.len() + free_indices(free).len();
    let freedom = (2 * corners).saturating_sub(unknowns).max(1) as f64;
    let covariance = System::of(&lens, &poses, views, free).covariance()? * (cost / freedom);
    let sigmas = std::array::from_fn(|i| {
        if free_indices(free).contains(&i) { covariance[(i, i)].max(0.0).sqrt() } else { 0.0 }
    });
    let rms = |(pose, view): (&Isometry3<f64>, &BoardView)| {
        let sum = cost_of(&lens, std::slice::from_ref(pose), std::slice::from_ref(view));
        (sum.unwrap_or(f64::INFINITY) / view.in_picture.len() as f64).sqrt()
    };
    Some(AdjustedLens {
        pinhole: pinhole_of(&lens, size),
        sigmas,
        rms_px: poses.iter().zip(views).map(rms).collect(),
        poses,
        cost,
    })
}

fn free_indices(free: FreeLens) -> &'static [usize] {
    match free {
        FreeLens::Fixed => &[],
        FreeLens::WithoutK3 => &[0, 1, 2, 3, 4, 5, 6, 7],
        FreeLens::WithK3 => &[0, 1, 2, 3, 4, 5, 6, 7, 8],
    }
}

fn vector_of(pinhole: &Pinhole) -> Lens {
    let (at, lens) = (pinhole.intrinsics(), pinhole.distortion());
    Lens::from([at.fx, at.fy, at.cx, at.cy, lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
}

fn pinhole_of(lens: &Lens, [width, height]: [u32; 2]) -> Pinhole {
    let intrinsics = Intrinsics { fx: lens[0], fy: lens[1], cx: lens[2], cy: lens[3], width, height };
    Pinhole::new(intrinsics, distortion_of(lens))
}

fn distortion_of(lens: &Lens) -> Distortion {
    Distortion { k1: lens[4], k2: lens[5], p1: lens[6], p2: lens[7], k3: lens[8] }
}

/// Projects without the range check of [`Pinhole::project`], which an iteration may leave; `None` behind the camera.
fn project(lens: &Lens, point: &Point3<f64>) -> Option<Vector2<f64>> {
    let ideal = point.xy().coords / point.z;
    let distorted = distortion_of(lens).distort(ideal);
    let pixel = Vector2::new(lens[0] * distorted.x + lens[2], lens[1] * distorted.y + lens[3]);
    (point.z > 1e-6 && pixel.iter().all(|value| value.is_finite())).then_some(pixel)
}

fn cost_of(lens: &Lens, poses: &[Isometry3<f64>], views: &[BoardView]) -> Option<f64> {
    let mut cost = 0.0;
    for (pose, view) in poses.iter().zip(views) {
        for (corner, seen) in view.on_board.iter().zip(&view.in_picture) {
            cost += (project(lens, &(pose * Point3::from(corner.push(0.0))))? - seen).norm_squared();
        }
    }
    Some(cost).filter(|cost| cost.is_finite())
}

/// Moves a pose by a turn about the axes of the camera (first three) and a translation.
fn moved(pose: &Isometry3<f64>, step: &PoseVector) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
    Isometry3::from_parts((pose.translation.vector + step.fixed_rows::<3>(3)).into(), turn * pose.rotation)
}

/// Normal equations: of the lens, and for each view of its pose and of both.
struct System {
    lens: LensMatrix,
    lens_right: Lens,
    views: Vec<(PoseMatrix, Cross, PoseVector)>,
    free: FreeLens,
}

impl System {
    fn of(lens: &Lens, poses: &[Isometry3<f64>], views: &[BoardView], free: FreeLens) -> Self {
        let mut system =
            Self { lens: LensMatrix::zeros(), lens_right: Lens::zeros(), views: Vec::new(), free };
        for (pose, view) in poses.iter().zip(views) {
            let (mut own, mut cross, mut right) = (PoseMatrix::zeros(), Cross::zeros(), PoseVector::zeros());
            for (corner, seen) in view.on_board.iter().zip(&view.in_picture) {
                let rotated = pose.rotation * corner.push(0.0);
                let point = Point3::from(rotated + pose.translation.vector);
                let Some(pixel) = project(lens, &point) else { continue };
                let (by_lens, by_pose) = jacobians(lens, &point, rotated);
                let residual = seen - pixel;
                system.lens += by_lens.transpose() * by_lens;
                system.lens_right += by_lens.transpose() * residual;
                own += by_pose.transpose() * by_pose;
                cross += by_lens.transpose() * by_pose;
                right += by_pose.transpose() * residual;
            }
            system.views.push((own, cross, right));
        }
        system
    }

    /// Returns the equations of the lens alone, and the inverses of the poses' own.
    fn reduced(&self, damping: f64) -> Option<(LensMatrix, Lens, Vec<PoseMatrix>)> {
        let mut left = self.lens;
        for i in 0..PARAMETERS {
            left[(i, i)] *= 1.0 + damping;
        }
        let (mut right, mut inverses) = (self.lens_right, Vec::with_capacity(self.views.len()));
        for (own, cross, own_right) in &self.views {
            let mut own = *own;
            for i in 0..6 {
                own[(i, i)] *= 1.0 + damping;
            }
            let inverse = own.cholesky()?.inverse();
            left -= cross * inverse * cross.transpose();
            right -= cross * inverse * own_right;
            inverses.push(inverse);
        }
        for i in (0..PARAMETERS).filter(|i| !free_indices(self.free).contains(i)) {
            left.fill_row(i, 0.0);
            left.fill_column(i, 0.0);
            left[(i, i)] = 1.0;
            right[i] = 0.0;
        }
        Some((left, right, inverses))
    }

    fn solve(&self, damping: f64) -> Option<(Lens, Vec<PoseVector>)> {
        let (left, right, inverses) = self.reduced(damping)?;
        let lens = left.cholesky()?.solve(&right);
        let pose = |((_, cross, right), inverse): (&(PoseMatrix, Cross, PoseVector), &PoseMatrix)| {
            inverse * (right - cross.transpose() * lens)
        };
        let poses: Vec<PoseVector> = self.views.iter().zip(&inverses).map(pose).collect();
        let is_finite = lens.iter().chain(poses.iter().flatten()).all(|value| value.is_finite());
        is_finite.then_some((lens, poses))
    }

    /// Covariance of the lens for corners with a variance of 1 px^2.
    fn covariance(&self) -> Option<LensMatrix> {
        let (left, _, _) = self.reduced(0.0)?;
        left.cholesky().map(|factors| factors.inverse())
    }
}

/// Derivatives of a pixel with respect to the lens, and to the turn and the translation of the board.
fn jacobians(
    lens: &Lens,
    point: &Point3<f64>,
    rotated: Vector3<f64>,
) -> (SMatrix<f64, 2, PARAMETERS>, SMatrix<f64, 2, 6>) {
    let (x, y) = (point.x / point.z, point.y / point.z);
    let distortion = distortion_of(lens);
    let distorted = distortion.distort(Vector2::new(x, y));
    let r2 = x * x + y * y;
    let radial = [r2, r2 * r2, r2 * r2 * r2];
    let mut by_lens = SMatrix::<f64, 2, PARAMETERS>::zeros();
    by_lens[(0, 0)] = distorted.x;
    by_lens[(1, 1)] = distorted.y;
    by_lens[(0, 2)] = 1.0;
    by_lens[(1, 3)] = 1.0;
    for (column, power) in [(4, radial[0]), (5, radial[1]), (8, radial[2])] {
        by_lens[(0, column)] = lens[0] * x * power;
        by_lens[(1, column)] = lens[1] * y * power;
    }
    by_lens[(0, 6)] = lens[0] * 2.0 * x * y;
    by_lens[(1, 6)] = lens[1] * (r2 + 2.0 * y * y);
    by_lens[(0, 7)] = lens[0] * (r2 + 2.0 * x * x);
    by_lens[(1, 7)] = lens[1] * 2.0 * x * y;
    let mut by_ideal = distortion.jacobian(Vector2::new(x, y));
    by_ideal.row_mut(0).scale_mut(lens[0]);
    by_ideal.row_mut(1).scale_mut(lens[1]);
    let depth = 1.0 / point.z;
    let by_point = by_ideal * Matrix2x3::new(depth, 0.0, -x * depth, 0.0, depth, -y * depth);
    let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
    by_pose.fixed_columns_mut::<3>(0).copy_from(&(-by_point * rotated.cross_matrix()));
    by_pose.fixed_columns_mut::<3>(3).copy_from(&by_point);
    (by_lens, by_pose)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jacobians_match_differences() {
        let lens = Lens::from([560.0, 550.0, 320.0, 240.0, -0.2, 0.06, 1e-3, -2e-3, 0.01]);
        let pose = Isometry3::new(Vector3::new(0.05, -0.1, 0.6), Vector3::new(0.3, -0.2, 0.1));
        let corner = Vector3::new(0.1, 0.05, 0.0);
        let at = |lens: &Lens, pose: &Isometry3<f64>| project(lens, &(pose * Point3::from(corner))).unwrap();
        let rotated = pose.rotation * corner;
        let (by_lens, by_pose) = jacobians(&lens, &(pose * Point3::from(corner)), rotated);
        for i in 0..PARAMETERS {
            let step = Lens::from_fn(|row, _| if row == i { 1e-6 } else { 0.0 });
            let difference = (at(&(lens + step), &pose) - at(&(lens - step), &pose)) / 2e-6;
            assert!((difference - by_lens.column(i)).norm() < 1e-3, "lens {i}");
        }
        for i in 0..6 {
            let step = PoseVector::from_fn(|row, _| if row == i { 1e-6 } else { 0.0 });
            let difference = (at(&lens, &moved(&pose, &step)) - at(&lens, &moved(&pose, &-step))) / 2e-6;
            assert!((difference - by_pose.column(i)).norm() < 1e-3, "pose {i}");
        }
    }
}
