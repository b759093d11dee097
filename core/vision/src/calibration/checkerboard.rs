//! Detection of a printed checkerboard in an image, with its inner corners to a fraction of a pixel.

use nalgebra::{Matrix2, Vector2};
use thiserror::Error;
use yamabico_geometry::image::ImageView;

use super::board::Board;
use super::corner_grid::CornerGrid;
use super::float_image::FloatImage;
use super::grid_nodes::{Nodes, bounds, is_regular, sides, trimmed};
use super::homography::{apply, homography};
use super::saddle_points::{SaddlePoint, saddle_at, saddle_points};

/// Smoothing before corners are searched, px of the searched image.
const SMOOTHING_PX: f64 = 1.2;
/// Width that an image is reduced to before the first search, px.
const SEARCH_WIDTH: usize = 1000;
/// Smallest width of a reduced image, px.
const MIN_WIDTH: usize = 200;
/// Smallest number of corners along a side of a grid that counts as a board.
const MIN_SIDE: usize = 3;
/// Number of seeds that grids are grown from.
const MAX_SEEDS: usize = 60;
/// Distance of a corner from the plane that the others span, as a share of a square, above which the grid is no board.
const MAX_OFF_PLANE: f64 = 0.25;
/// Half the side of the window in which a corner is measured: share of a square, and bounds, px.
const WINDOW_SHARE: f64 = 0.4;
const WINDOW_PX: std::ops::RangeInclusive<f64> = 2.5..=12.0;

/// Inner corners of a board in an image, px, row by row as in [`Board::corners`].
#[derive(Clone, Debug, PartialEq)]
pub struct FoundBoard {
    /// Corners, distorted pixels.
    pub corners: Vec<Vector2<f64>>,
}

/// Reason why the board was not found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NotFound {
    /// Nothing in the image looks like a checkerboard.
    #[error("no checkerboard is in view: show the whole board, without glare, sharp")]
    NoBoard,
    /// The grid in view has fewer corners than the board.
    #[error(
        "only {found} of {wanted} corners are in view, a part of {columns}x{rows}: show the whole board, without glare, sharp"
    )]
    Partial {
        /// Corners in view.
        found: usize,
        /// Corners of the board.
        wanted: usize,
        /// Corners along the longer side of the part in view.
        columns: usize,
        /// Corners along its shorter side.
        rows: usize,
    },
    /// The grid in view has more corners than the board.
    #[error(
        "the board in view has {columns}x{rows} inner corners or more: correct the number of corners, which are those inside of the board"
    )]
    Larger {
        /// Corners along the longer side.
        columns: usize,
        /// Corners along the shorter side.
        rows: usize,
    },
}

impl NotFound {
    /// Size of a whole grid that was seen in place of the board: corners along the longer and the shorter side.
    #[must_use]
    pub fn other_board(&self) -> Option<[usize; 2]> {
        match *self {
            Self::NoBoard => None,
            Self::Partial { found, columns, rows, .. } => {
                (found == columns * rows).then_some([columns, rows])
            }
            Self::Larger { columns, rows } => Some([columns, rows]),
        }
    }

    /// Returns true if what was seen is neither a whole grid nor a considerable part of the board.
    fn is_resemblance(&self) -> bool {
        match *self {
            Self::Partial { found, wanted, .. } => 4 * found < wanted && self.other_board().is_none(),
            Self::NoBoard | Self::Larger { .. } => false,
        }
    }

    /// Number of corners that were seen.
    fn rank(&self) -> usize {
        match *self {
            Self::NoBoard => 0,
            Self::Partial { found, .. } => found,
            Self::Larger { columns, rows } => columns * rows,
        }
    }
}

/// Finds the board in an image. All of its corners must be in view; tiles and shelves that resemble a small part of it are no board.
///
/// # Errors
/// [`NotFound`], with the largest grid that was seen instead.
pub fn find_board(image: ImageView<'_>, board: &Board) -> Result<FoundBoard, NotFound> {
    let full = FloatImage::of(image);
    let mut levels = vec![full];
    while let Some(last) = levels.last().filter(|last| last.width.min(last.height) >= 2 * MIN_WIDTH) {
        levels.push(last.halved());
    }
    let first = levels.iter().position(|level| level.width <= SEARCH_WIDTH).unwrap_or(levels.len() - 1);
    let mut failure = NotFound::NoBoard;
    // The coarser image shows a blurred board, the finer one small squares.
    for level in [Some(first), Some(first + 1), first.checked_sub(1)].into_iter().flatten() {
        let Some(searched) = levels.get(level) else { continue };
        match find_in(searched, board) {
            Ok(corners) => {
                let scale = f64::from(1_u32 << level);
                let corners: Vec<_> = corners
                    .iter()
                    .map(|corner| corner * scale + Vector2::repeat(0.5 * (scale - 1.0)))
                    .collect();
                return Ok(FoundBoard { corners: measured(&levels[0], board, &corners) });
            }
            Err(reason) if reason.rank() > failure.rank() => failure = reason,
            Err(_) => {}
        }
    }
    // Squares of few pixels, as of a board that lies on the floor.
    if levels[0].width <= SEARCH_WIDTH {
        match find_in(&levels[0].doubled(), board) {
            Ok(corners) => {
                let corners: Vec<_> =
                    corners.iter().map(|corner| 0.5 * corner - Vector2::repeat(0.25)).collect();
                return Ok(FoundBoard { corners: measured(&levels[0], board, &corners) });
            }
            Err(reason) if reason.rank() > failure.rank() => failure = reason,
            Err(_) => {}
        }
    }
    Err(if failure.is_resemblance() { NotFound::NoBoard } else { failure })
}

/// Finds the corners in an image, coarsely.
fn find_in(image: &FloatImage, board: &Board) -> Result<Vec<Vector2<f64>>, NotFound> {
    let smooth = image.smoothed(SMOOTHING_PX);
    let points = saddle_points(&smooth);
    let grid = CornerGrid::new(&points);
    let mut is_taken = vec![false; points.len()];
    let mut failure = NotFound::NoBoard;
    for seed in 0..points.len().min(MAX_SEEDS) {
        if is_taken[seed] {
            continue;
        }
        let nodes = trimmed(grid.grow(seed, &|index| !is_taken[index]));
        if sides(&nodes)[1] < MIN_SIDE || !is_regular(&nodes, &points) {
            continue;
        }
        nodes.values().for_each(|&index| is_taken[index] = true);
        match whole(&smooth, &points, &grid, nodes, board) {
            Ok(corners) => return Ok(corners),
            Err(reason) if reason.rank() > failure.rank() => failure = reason,
            Err(_) => {}
        }
    }
    Err(failure)
}

/// Returns the corners of a grid in the order of the board, if it is the whole board.
fn whole(
    image: &FloatImage,
    points: &[SaddlePoint],
    grid: &CornerGrid<'_>,
    nodes: Nodes,
    board: &Board,
) -> Result<Vec<Vector2<f64>>, NotFound> {
    let [columns, rows] = sides(&nodes);
    let found = nodes.len();
    if columns > board.columns || rows > board.rows {
        return Err(NotFound::Larger { columns, rows });
    }
    let partial = NotFound::Partial { found, wanted: board.count(), columns, rows };
    if [columns, rows] != [board.columns, board.rows] {
        return Err(partial);
    }
    let (low, high) = bounds(&nodes);
    let is_wide = high[0] - low[0] > high[1] - low[1] || board.columns == board.rows;
    let mut at = Vec::with_capacity(board.count());
    for row in 0..board.rows as i32 {
        for column in 0..board.columns as i32 {
            let node =
                if is_wide { [low[0] + column, low[1] + row] } else { [low[0] + row, low[1] + column] };
            at.push(match nodes.get(&node) {
                Some(&index) => points[index],
                None => missing(image, grid, &nodes, node).ok_or(partial)?,
            });
        }
    }
    if !is_plane(board, &at) {
        return Err(partial);
    }
    Ok(ordered(board, at))
}

/// Looks for a corner that was not among the strongest points where its neighbors predict it.
fn missing(image: &FloatImage, grid: &CornerGrid<'_>, nodes: &Nodes, node: [i32; 2]) -> Option<SaddlePoint> {
    [[1, 0], [-1, 0], [0, 1], [0, -1]].into_iter().find_map(|step: [i32; 2]| {
        let from = [node[0] - step[0], node[1] - step[1]];
        let (predicted, _) = grid.predict(nodes, from, step)?;
        saddle_at(image, predicted)
    })
}

/// Returns true if the corners lie on a plane, but for the distortion of a lens.
fn is_plane(board: &Board, at: &[SaddlePoint]) -> bool {
    let at: Vec<Vector2<f64>> = at.iter().map(|point| point.at).collect();
    let on_board = board.corners();
    let Some(image_from_board) = homography(&on_board, &at) else { return false };
    let square = |corner: Vector2<f64>| {
        let along = |step: Vector2<f64>| {
            (apply(&image_from_board, corner + step) - apply(&image_from_board, corner)).norm()
        };
        along(Vector2::new(board.square_m, 0.0)).min(along(Vector2::new(0.0, board.square_m)))
    };
    on_board.iter().zip(&at).all(|(corner, seen)| {
        (apply(&image_from_board, *corner) - seen).norm() < MAX_OFF_PLANE * square(*corner).max(8.0)
    })
}

/// Turns the grid such that x and y of the board are a right-handed pair in the image, as on the printed page, and that its first
/// square is black where that is different for the two ends of the board; else its first corner is the left one.
fn ordered(board: &Board, mut at: Vec<SaddlePoint>) -> Vec<Vector2<f64>> {
    let (columns, rows) = (board.columns, board.rows);
    let along = at[columns - 1].at - at[0].at;
    let across = at[(rows - 1) * columns].at - at[0].at;
    if along.x * across.y - along.y * across.x < 0.0 {
        at.chunks_exact_mut(columns).for_each(<[SaddlePoint]>::reverse);
    }
    let is_distinct = (columns + rows) % 2 == 1;
    let is_turned = if is_distinct {
        !is_dark_towards(&at[0], at[columns + 1].at)
    } else {
        let last = at[at.len() - 1].at;
        last.x < at[0].at.x
    };
    if is_turned {
        at.reverse();
    }
    at.into_iter().map(|point| point.at).collect()
}

/// Returns true if the square from a corner towards `diagonal` is black.
fn is_dark_towards(corner: &SaddlePoint, diagonal: Vector2<f64>) -> bool {
    let [first, second] = corner.lines;
    let Some(inverse) = Matrix2::from_columns(&[first, second]).try_inverse() else { return false };
    let parts = inverse * (diagonal - corner.at);
    (parts.x * parts.y > 0.0) == corner.is_dark_between
}

/// Measures every corner on the full image.
fn measured(image: &FloatImage, board: &Board, corners: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let window = |index: usize| {
        let (column, row) = (index % board.columns, index / board.columns);
        let side = |other: usize| (corners[other] - corners[index]).norm();
        let across = side(if column > 0 { index - 1 } else { index + 1 });
        let down = side(if row > 0 { index - board.columns } else { index + board.columns });
        (WINDOW_SHARE * across.min(down)).clamp(*WINDOW_PX.start(), *WINDOW_PX.end())
    };
    let smooth = image.smoothed(0.7);
    corners.iter().enumerate().map(|(index, corner)| crossing(&smooth, *corner, window(index))).collect()
}

/// Returns the point near `start` from which all gradients around it are seen at a right angle, as from the crossing of two straight
/// edges (Förstner & Gülch 1987); `start` if it moves away.
fn crossing(image: &FloatImage, start: Vector2<f64>, half: f64) -> Vector2<f64> {
    let mut at = start;
    let reach = half.ceil() as i32 + 1;
    for _ in 0..12 {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        let middle = at.map(f64::round);
        for dv in -reach..=reach {
            for du in -reach..=reach {
                let pixel = middle + Vector2::new(f64::from(du), f64::from(dv));
                let offset = pixel - at;
                let weight = (-2.0 * offset.norm_squared() / (half * half)).exp();
                let (u, v) = (pixel.x as isize, pixel.y as isize);
                let gradient = Vector2::new(
                    f64::from(image.at(u + 1, v) - image.at(u - 1, v)),
                    f64::from(image.at(u, v + 1) - image.at(u, v - 1)),
                );
                let outer = gradient * gradient.transpose() * weight;
                normal += outer;
                right += outer * offset;
            }
        }
        let Some(inverse) = normal.try_inverse() else { return start };
        let step: Vector2<f64> = inverse * right;
        at += step;
        if !(at - start).norm().is_finite() || (at - start).norm() > half.max(2.5) {
            return start;
        }
        if step.norm() < 1e-3 {
            break;
        }
    }
    at
}
