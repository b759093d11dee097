//! Variety of the views of a board: how they differ, and what further pictures should show.

use nalgebra::{Isometry3, Vector2, Vector3};
use std::fmt;

/// Range of the board's inclination about an axis from which on it determines focal length and principal point well, rad.
const ENOUGH_INCLINATION_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Share of the image that the largest view should cover.
const ENOUGH_SHARE: f64 = 0.15;
/// Mean distance between the corners of two views below which they are the same, as a share of the image's width.
const SAME_VIEW_SHARE: f64 = 0.02;
/// Cells into which the image is divided along each side.
const CELLS: usize = 3;
/// Names of the cells, row by row.
const PLACES: [&str; CELLS * CELLS] = [
    "upper left corner",
    "upper edge",
    "upper right corner",
    "left edge",
    "middle",
    "right edge",
    "lower left corner",
    "lower edge",
    "lower right corner",
];

/// Differences between the views of a board.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewVariety {
    /// Number of views that differ from all before them.
    pub distinct: usize,
    /// Range of the board's inclination about the vertical of the camera (left or right edge nearer), rad.
    pub about_vertical: f64,
    /// Range of its inclination about the horizontal (upper or lower edge nearer), rad.
    pub about_horizontal: f64,
    /// Share of the image that the largest view covers.
    pub largest_share: f64,
    /// Parts of the image in which no view has a corner.
    pub empty: Vec<&'static str>,
}

/// Kind of picture that is missing.
#[derive(Clone, Debug, PartialEq)]
pub enum Advice {
    /// Pictures with the left edge of the board nearer, and others with the right one.
    TurnAboutVertical,
    /// Pictures with the upper edge of the board nearer, and others with the lower one.
    TurnAboutHorizontal,
    /// Pictures of the board from nearer.
    Nearer,
    /// Pictures with the board at these places of the image.
    Places(Vec<&'static str>),
    /// Pictures that differ from those there are.
    Other,
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TurnAboutVertical => {
                write!(
                    f,
                    "pictures with the left edge of the board nearer by a third of its width, and some with the right edge"
                )
            }
            Self::TurnAboutHorizontal => {
                write!(
                    f,
                    "pictures with the upper edge of the board nearer by a third of its height, and some with the lower edge"
                )
            }
            Self::Nearer => write!(f, "pictures in which the board fills a third of the image"),
            Self::Places(places) => {
                write!(f, "pictures with the board at the {} of the image", places.join(", "))
            }
            Self::Other => write!(f, "pictures from other directions and distances"),
        }
    }
}

impl ViewVariety {
    /// Compares views: the corners of each, px, and the poses (camera from board).
    #[must_use]
    pub fn of(corners: &[&[Vector2<f64>]], poses: &[Isometry3<f64>], [width, height]: [u32; 2]) -> Self {
        let size = Vector2::new(f64::from(width), f64::from(height));
        let is_same = |a: &[Vector2<f64>], b: &[Vector2<f64>]| {
            let mean = a.iter().zip(b).map(|(a, b)| (a - b).norm()).sum::<f64>() / a.len().max(1) as f64;
            mean < SAME_VIEW_SHARE * size.x
        };
        let is_new = |(index, view): (usize, &&[Vector2<f64>])| {
            !corners[..index].iter().any(|other| is_same(view, other))
        };
        let distinct = corners.iter().enumerate().filter(|view| is_new(*view)).count();
        let normals: Vec<Vector3<f64>> =
            poses.iter().map(|pose| facing(pose.rotation * Vector3::z())).collect();
        let inclination = |axis: usize| range(normals.iter().map(|normal| normal[axis].atan2(normal.z)));
        let share = |view: &&[Vector2<f64>]| {
            let [across, down] =
                [0, 1].map(|axis| range(view.iter().map(|corner| corner[axis])) / size[axis]);
            across * down
        };
        let mut counts = [0; CELLS * CELLS];
        for corner in corners.iter().copied().flatten() {
            let [column, row] =
                [0, 1].map(|axis| (corner[axis] / size[axis] * CELLS as f64).clamp(0.0, 2.9) as usize);
            counts[row * CELLS + column] += 1;
        }
        Self {
            distinct,
            about_vertical: inclination(0),
            about_horizontal: inclination(1),
            largest_share: corners.iter().map(share).fold(0.0, f64::max),
            empty: counts
                .iter()
                .zip(PLACES)
                .filter(|(count, _)| **count == 0)
                .map(|(_, place)| place)
                .collect(),
        }
    }

    /// Pictures to add, the most useful first.
    #[must_use]
    pub fn advice(&self) -> Vec<Advice> {
        let turns = [
            (self.about_vertical, Advice::TurnAboutVertical),
            (self.about_horizontal, Advice::TurnAboutHorizontal),
        ];
        let turns =
            turns.into_iter().filter(|(range, _)| *range < ENOUGH_INCLINATION_RAD).map(|(_, advice)| advice);
        let nearer = (self.largest_share < ENOUGH_SHARE).then_some(Advice::Nearer);
        let places = (!self.empty.is_empty()).then(|| Advice::Places(self.empty.clone()));
        turns.chain(nearer).chain(places).collect()
    }
}

/// Returns the normal of the board that points away from the camera.
fn facing(normal: Vector3<f64>) -> Vector3<f64> {
    if normal.z < 0.0 { -normal } else { normal }
}

fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) =
        values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)));
    (high - low).max(0.0)
}
