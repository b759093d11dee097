//! Observation of the path ahead in the image of one camera.

use nalgebra::Vector2;
use yamabico_core::behavior::ParameterError;
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{FreeDirection, Reason};
use yamabico_vision::floor_appearance::{LearnedLook, Picture};

use super::cell_detector::{CellDetector, Polarity};
use super::cells::{Cells, GridSize};
use super::decision::Passage;
use super::ground::{GroundGrid, Swath};
use super::look_cells::LookCells;
use super::steering::Observation;
use super::weights::WeightSets;
use crate::config::{Config, Evidence, PolarityRule};
use crate::echoes::Echoes;

/// Share of obstacles among the weighted cells above which the floor itself looks like an obstacle.
const MAX_OBSTACLE_SHARE: f64 = 0.6;
/// Additional free length of the path at which a turn ends, m.
const SPARE_LENGTH_M: f64 = 0.1;
/// Additional clearance on either side of the path at which a turn ends, m.
const SPARE_SIDE_M: f64 = 0.05;

/// Reason why an image gives no reliable observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridFailure {
    /// Floor and obstacles cannot be distinguished: darkness, glare, a covered lens, or a single surface.
    LowContrast,
    /// More than 60 % of the floor cells in and beside the path ahead look like obstacles.
    FloorModelBroken,
    /// At the start, the floor directly in front of the robot looks like an obstacle: wrong polarity, or an object.
    NoFloorAhead,
}

impl GridFailure {
    /// Returns the reason for the proposal.
    #[must_use]
    pub const fn reason(self) -> Reason {
        match self {
            GridFailure::LowContrast => Reason::LowContrast,
            GridFailure::FloorModelBroken | GridFailure::NoFloorAhead => Reason::FloorModelBroken,
        }
    }
}

/// Detector of obstacle cells by either evidence.
#[derive(Clone, Debug)]
enum Detector {
    Brightness { cells: Box<CellDetector>, polarity: Option<Polarity>, has_started: bool },
    Look(Box<LookCells>),
}

/// Observer of the path ahead in images of one camera.
#[derive(Clone, Debug)]
pub struct PathObserver {
    detector: Detector,
    ground: GroundGrid,
    sets: WeightSets,
    /// Number of cells of each column that the robot's path covers.
    path: Vec<u32>,
    /// Number of cells of each column that the path with additional clearance covers.
    spare: Vec<u32>,
    free: Vec<u32>,
    directions: Vec<FreeDirection>,
}

impl PathObserver {
    /// Creates the observer for a camera and a path ahead; `look` is the floor's look as learned before.
    ///
    /// # Errors
    /// The camera shows no floor or no part of the path, or the path is not finite.
    pub fn new(
        config: &Config,
        camera: &Pinhole,
        mount: &Mount,
        path: &Swath,
        look: LearnedLook,
    ) -> Result<Self, ParameterError> {
        let size = config.grid();
        let ground = GroundGrid::new(size, camera, mount);
        let broken = |problem: String| Err(ParameterError::new("inputs.camera", problem));
        let Some(nearest_m) = ground.nearest_m() else {
            return broken("shows no floor: mount it above the floor and tilt it further down".into());
        };
        let (length_m, half_width_m) = (path.length_m, path.half_width_m);
        let sets = WeightSets::for_profile(&ground.cells_of(&path.enlarged(0.0, config.freer_side_m)));
        let Some(sets) = sets.filter(|_| nearest_m < length_m) else {
            return broken(format!(
                "shows the floor from {nearest_m:.2} m on, but the robot stops within {length_m:.2} m: tilt the camera \
                 further down, or raise `speed_mps` or `margin_m`"
            ));
        };
        if !half_width_m.is_finite() || !length_m.is_finite() {
            return broken(
                "cannot show an infinite stopping distance: correct the robot's radius, speed or deceleration".into(),
            );
        }
        let detector = match config.evidence {
            Evidence::Brightness => Detector::Brightness {
                cells: Box::new(CellDetector::new(size, config.min_contrast, config.floor_evenness)),
                polarity: match config.polarity {
                    PolarityRule::BrightFloor => Some(Polarity::BrightFloor),
                    PolarityRule::DarkFloor => Some(Polarity::DarkFloor),
                    PolarityRule::Auto => None,
                },
                has_started: false,
            },
            Evidence::Look => Detector::Look(Box::new(LookCells::new(size, camera, mount, look))),
        };
        Ok(Self {
            detector,
            path: ground.cells_of(path),
            spare: ground.cells_of(&path.enlarged(SPARE_LENGTH_M, SPARE_SIDE_M)),
            ground,
            sets,
            free: Vec::with_capacity(size.columns),
            directions: Vec::with_capacity(size.columns),
        })
    }

    /// Observes the path ahead in an image of the camera; floor behind an echo is not free. With [`GridFailure::FloorModelBroken`], the path is
    /// obstructed, but the weights still give the freer side.
    pub fn observe(&mut self, picture: Picture, echoes: &Echoes) -> (Observation, Option<GridFailure>) {
        self.directions.clear();
        let cells = match self.detector.mark(picture) {
            Ok(cells) => cells,
            Err(failure) => return (Observation::Unclear, Some(failure)),
        };
        cells.profile(&mut self.free);
        let share = cells.obstacle_share(&self.sets.profile);
        self.bound(echoes);
        let weights = self.sets.weigh(&self.free);
        if share > MAX_OBSTACLE_SHARE {
            return (Observation::Seen(weights, Passage::Obstructed), Some(GridFailure::FloorModelBroken));
        }
        let ends = self.free.iter().enumerate().rev();
        self.directions.extend(ends.filter_map(|(column, &free)| self.ground.end(column, free)));
        (Observation::Seen(weights, self.passage()), None)
    }

    /// Returns true if colors of an image are evidence.
    #[must_use]
    pub fn uses_color(&self) -> bool {
        matches!(self.detector, Detector::Look(_))
    }

    /// Learns the floor's look from the last image, taken at pose `seen_from`, and what the robot (a circle of `radius_m`) covers now,
    /// at pose `now`, after `elapsed_s`; poses in the odometry frame. Does nothing if brightness is the evidence.
    pub fn learn(&mut self, seen_from: &Pose2, now: &Pose2, radius_m: f64, elapsed_s: f64) {
        if let Detector::Look(cells) = &mut self.detector {
            cells.learn(seen_from, now, radius_m, elapsed_s);
        }
    }

    /// Returns the end of free floor of each column in the last image, from right to left; empty after a failure.
    #[must_use]
    pub fn directions(&self) -> &[FreeDirection] {
        &self.directions
    }

    /// Returns the cells of the last image that had a threshold.
    #[must_use]
    pub fn cells(&self) -> &Cells {
        match &self.detector {
            Detector::Brightness { cells, .. } => cells.marked(),
            Detector::Look(cells) => cells.marked(),
        }
    }

    /// Returns the number of free cells from the bottom of each column from the left.
    #[must_use]
    pub fn free(&self) -> &[u32] {
        &self.free
    }

    /// Returns the number of cells in each column that the robot's path covers, and the number of those that are
    /// weighted.
    #[must_use]
    pub fn covered(&self) -> (&[u32], &[u32]) {
        (&self.path, &self.sets.profile)
    }

    /// Returns the grid on the floor.
    #[must_use]
    pub fn ground(&self) -> &GroundGrid {
        &self.ground
    }

    /// Returns the size of the grid.
    #[must_use]
    pub fn size(&self) -> GridSize {
        self.cells().size()
    }

    /// Lowers the number of free cells of each column to those before the nearest echo in it.
    fn bound(&mut self, echoes: &Echoes) {
        for (column, free) in self.free.iter_mut().enumerate() {
            let Some((right, left)) = self.ground.borders(column) else { continue };
            let echo_m = echoes.nearest_m(Vector2::zeros(), (right, left));
            let end_m = |free: u32| self.ground.end(column, free).map_or(0.0, |end| end.distance_m);
            while *free > 0 && end_m(*free) > echo_m {
                *free -= 1;
            }
        }
    }

    fn passage(&self) -> Passage {
        let is_free = |covered: &[u32]| self.free.iter().zip(covered).all(|(free, covered)| free >= covered);
        if !is_free(&self.path) {
            Passage::Obstructed
        } else if !is_free(&self.spare) {
            Passage::Narrow
        } else {
            Passage::Open
        }
    }
}

impl Detector {
    /// Marks the cells of an image.
    fn mark(&mut self, picture: Picture) -> Result<&Cells, GridFailure> {
        match (self, picture) {
            (Self::Brightness { cells, polarity, has_started }, Picture::Gray(image)) => {
                cells.measure(image).map_err(|_| GridFailure::LowContrast)?;
                if !*has_started {
                    *polarity = Some(start(cells, *polarity).ok_or(GridFailure::NoFloorAhead)?);
                    *has_started = true;
                }
                if cells.cells(polarity.unwrap_or(Polarity::BrightFloor)).is_foreground_free() {
                    cells.learn_floor();
                }
                Ok(cells.marked())
            }
            // Brightness is that of gray images.
            (Self::Brightness { .. }, Picture::Color(_)) => Err(GridFailure::LowContrast),
            (Self::Look(cells), picture) => cells.mark(picture).map_err(|_| GridFailure::LowContrast),
        }
    }
}

/// Returns the polarity, once the foreground has been floor.
fn start(cells: &mut CellDetector, polarity: Option<Polarity>) -> Option<Polarity> {
    let tried = match polarity {
        Some(polarity) => &[polarity][..],
        None => &[Polarity::BrightFloor, Polarity::DarkFloor],
    };
    tried.iter().copied().find(|&polarity| cells.cells(polarity).is_foreground_free())
}
