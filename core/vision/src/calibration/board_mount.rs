//! Mount of a camera from a board that lies on the floor.

use nalgebra::{Isometry3, Vector3};
use thiserror::Error;
use yamabico_geometry::camera::{Mount, Pinhole};

use super::board::Board;
use super::checkerboard::FoundBoard;
use super::closed_form::pose_of;
use super::homography::homography;
use super::lens_adjustment::{BoardView, FreeLens, adjust};
use super::spread::{median, robust_sigma};

/// Root mean square residual of a picture above which it is not used, as a share of the picture's width.
const MAX_RMS_SHARE: f64 = 0.004;

/// Mount of the camera as the pictures of a board on the floor give it, with standard deviations between the pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardMount {
    /// Height, m.
    pub height_m: f64,
    /// Downward tilt, rad.
    pub tilt: f64,
    /// Roll, rad.
    pub roll: f64,
    /// Direction of the board's nearest side relative to the camera, rad within ±pi/4: minus the pan, if the board lies square to the robot.
    pub board_direction: f64,
    /// Standard deviations of height (m), tilt, roll and direction (rad) from picture to picture; `None` for a single picture.
    pub sigmas: Option<[f64; 4]>,
    /// Root mean square of the distances between corners and their projections in each picture, px; `None` for one that does not fit.
    pub rms_px: Vec<Option<f64>>,
}

/// Reason why pictures of a board give no mount.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum BoardMountError {
    /// The corners do not fit a plane.
    #[error(
        "the corners of the board fit no plane: measure the lens first (`yamabico calibrate intrinsics`), and lay the board flat"
    )]
    NoFit,
    /// The board is not below the camera.
    #[error(
        "the board does not lie on the floor: it is seen at an angle of {angle_deg:.0}° to the axis of the camera's picture"
    )]
    NotOnFloor {
        /// Index of the picture.
        picture: usize,
        /// Angle between the board's normal and the vertical of the picture, degrees.
        angle_deg: f64,
    },
}

/// Computes the mount from the boards found in pictures of a camera with a known lens, at least one.
///
/// # Errors
/// [`BoardMountError`].
pub fn board_mount(
    pinhole: &Pinhole,
    board: &Board,
    found: &[FoundBoard],
) -> Result<BoardMount, BoardMountError> {
    let width = f64::from(pinhole.intrinsics().width);
    let mut rms_px = Vec::new();
    let mut numbers: [Vec<f64>; 4] = Default::default();
    for (picture, found) in found.iter().enumerate() {
        let placed = place(pinhole, board, found).filter(|(_, rms)| *rms < MAX_RMS_SHARE * width);
        rms_px.push(placed.map(|(_, rms)| rms));
        let Some((pose, _)) = placed else { continue };
        let not_on_floor = |angle_deg| BoardMountError::NotOnFloor { picture, angle_deg };
        for (all, number) in numbers.iter_mut().zip(mount_of(&pose).map_err(not_on_floor)?) {
            all.push(number);
        }
    }
    let middle = |axis: usize| median(&numbers[axis]).ok_or(BoardMountError::NoFit);
    let sigma = |axis: usize| {
        1.25 * robust_sigma(&numbers[axis]).unwrap_or(0.0) / (numbers[axis].len() as f64).sqrt()
    };
    Ok(BoardMount {
        height_m: middle(0)?,
        tilt: middle(1)?,
        roll: middle(2)?,
        board_direction: middle(3)?,
        sigmas: (numbers[0].len() > 1).then(|| std::array::from_fn(sigma)),
        rms_px,
    })
}

/// Returns the pose of a board (camera from board) and its residual, px.
fn place(pinhole: &Pinhole, board: &Board, found: &FoundBoard) -> Option<(Isometry3<f64>, f64)> {
    let on_board = board.corners();
    let straight: Option<Vec<_>> =
        found.corners.iter().map(|corner| pinhole.undistort_pixel(*corner)).collect();
    let pose = pose_of(&homography(&on_board, &straight?)?, pinhole.intrinsics())?;
    let view = BoardView { on_board, in_picture: found.corners.clone(), pose };
    let adjusted = adjust(pinhole, &[view], FreeLens::Fixed)?;
    Some((adjusted.poses[0], adjusted.rms_px[0]))
}

/// Height (m), tilt, roll and direction of the board (rad) for a board at this pose.
///
/// # Errors
/// Angle between its normal and the vertical of the picture, degrees, if it is not below the camera.
fn mount_of(pose: &Isometry3<f64>) -> Result<[f64; 4], f64> {
    let normal = pose.rotation * Vector3::z();
    // Towards the floor, away from the camera.
    let distance = normal.dot(&pose.translation.vector);
    let down = normal * distance.signum();
    if down.y < 0.2 {
        return Err(down.y.acos().to_degrees());
    }
    let (tilt, roll) = (down.z.clamp(-1.0, 1.0).asin(), down.x.atan2(down.y));
    let level_from_camera = Mount { tilt, roll, ..Mount::default() }.rotation_body_from_camera();
    let side = level_from_camera * (pose.rotation * Vector3::x());
    let quarter = std::f64::consts::FRAC_PI_2;
    let angle = side.y.atan2(side.x);
    Ok([distance.abs(), tilt, roll, angle - quarter * (angle / quarter).round()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector2};
    use yamabico_geometry::camera::{Distortion, Intrinsics};

    #[test]
    fn the_mount_is_read_from_a_board_on_the_floor() {
        let lens = Distortion { k1: -0.2, k2: 0.05, ..Distortion::NONE };
        let pinhole = Pinhole::new(Intrinsics::from_horizontal_fov(640, 480, 1.05), lens);
        let board = Board::new("9x6", 0.025).unwrap();
        let mount = Mount { z: 0.4, tilt: 0.3, roll: -0.04, pan: 0.06, ..Mount::default() };
        let seen = |turn: f64| {
            let at = |corner: &Vector2<f64>| {
                let (sin, cos) = turn.sin_cos();
                let (x, y) = (0.9 + cos * corner.x - sin * corner.y, sin * corner.x + cos * corner.y - 0.1);
                pinhole.project_from_body(&mount, &Point3::new(x, y, 0.0)).unwrap()
            };
            FoundBoard { corners: board.corners().iter().map(at).collect() }
        };
        let found = board_mount(&pinhole, &board, &[seen(0.0), seen(1.57), seen(-0.01)]).unwrap();
        assert!((found.height_m - 0.4).abs() < 1e-6 && (found.tilt - 0.3).abs() < 1e-6, "{found:?}");
        assert!((found.roll + 0.04).abs() < 1e-6 && (found.board_direction + 0.06).abs() < 0.01, "{found:?}");
        let upright = Isometry3::new(Vector3::new(0.0, 0.0, 1.0), Vector3::zeros());
        assert!(mount_of(&upright).is_err());
    }
}
