//! From a picture to what it says of the way ahead.

use yamabico_core::behavior::BuildError;
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::image::ImageView;
use yamabico_core::message::{FreeDirection, Reason};

use super::cells::{Cells, GridSize};
use super::decision::Passage;
use super::ground::{GroundGrid, Swath};
use super::look::{Look, Polarity};
use super::steering::Outlook;
use super::weights::Sets;
use crate::config::{Config, PolarityRule};

/// With a larger share of obstacles among the cells of the floor that is weighed, the floor itself looks like one.
const LARGEST_OBSTACLE_SHARE: f64 = 0.6;
/// A turn ends where the way is free for so much (m) farther ...
const SPARE_LENGTH_M: f64 = 0.1;
/// ... and wider on either side.
const SPARE_SIDE_M: f64 = 0.05;

/// What is wrong with a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// Floor and obstacles cannot be told apart: darkness, glare, a covered lens, or nothing but one surface.
    LowContrast,
    /// More than 60 % of the cells of the floor within the stopping distance look like obstacles.
    FloorModelBroken,
    /// At the start, the floor right before the robot looks like an obstacle: of the other polarity, or something is there.
    NoFloorAhead,
}

impl Trouble {
    /// In the common words.
    #[must_use]
    pub const fn reason(self) -> Reason {
        match self {
            Trouble::LowContrast => Reason::LowContrast,
            Trouble::FloorModelBroken | Trouble::NoFloorAhead => Reason::FloorModelBroken,
        }
    }
}

/// Sees the way ahead in pictures of one camera.
#[derive(Clone, Debug)]
pub struct Sight {
    look: Look,
    ground: GroundGrid,
    sets: Sets,
    /// Of each column, the cells that the robot's own way covers.
    way: Vec<u32>,
    /// The same with room to spare.
    spare: Vec<u32>,
    polarity: Option<Polarity>,
    has_started: bool,
    free: Vec<u32>,
    directions: Vec<FreeDirection>,
}

impl Sight {
    /// A sight for this camera, for a way ahead of this size.
    ///
    /// # Errors
    /// The camera shows no floor, or none of the way.
    pub fn new(config: &Config, camera: &Pinhole, mount: &Mount, way: &Swath) -> Result<Self, BuildError> {
        let size = config.grid();
        let ground = GroundGrid::new(size, camera, mount);
        let broken = |problem: String| Err(BuildError::new("inputs.camera", problem));
        let Some(nearest_m) = ground.nearest_m() else {
            return broken("shows no floor: mount it above the floor and tilt it further down".into());
        };
        let (length_m, half_width_m) = (way.length_m, way.half_width_m);
        let sets = Sets::for_profile(&ground.cells_of(&way.enlarged(0.0, config.freer_side_m)));
        let Some(sets) = sets.filter(|_| nearest_m < length_m) else {
            return broken(format!(
                "shows the floor from {nearest_m:.2} m on, but the robot stops within {length_m:.2} m: tilt the camera \
                 further down, drive faster or set a larger margin_m"
            ));
        };
        if !half_width_m.is_finite() || !length_m.is_finite() {
            return broken("the robot's radius, speed or deceleration give no finite way to stop".into());
        }
        Ok(Self {
            look: Look::new(size, config.min_contrast, config.floor_evenness),
            way: ground.cells_of(way),
            spare: ground.cells_of(&way.enlarged(SPARE_LENGTH_M, SPARE_SIDE_M)),
            ground,
            sets,
            polarity: match config.polarity {
                PolarityRule::BrightFloor => Some(Polarity::BrightFloor),
                PolarityRule::DarkFloor => Some(Polarity::DarkFloor),
                PolarityRule::Auto => None,
            },
            has_started: false,
            free: Vec::with_capacity(size.columns),
            directions: Vec::with_capacity(size.columns),
        })
    }

    /// What a picture of the camera says of the way ahead, and what is wrong with it. More obstacles than floor are never
    /// driven at, though the freer side is told.
    pub fn see(&mut self, image: ImageView) -> (Outlook, Option<Trouble>) {
        self.directions.clear();
        if self.look.measure(image).is_err() {
            return (Outlook::Unclear, Some(Trouble::LowContrast));
        }
        let Some(polarity) = self.start() else {
            return (Outlook::Unclear, Some(Trouble::NoFloorAhead));
        };
        let cells = self.look.cells(polarity);
        cells.profile(&mut self.free);
        let has_foreground = cells.is_foreground_free();
        let share = cells.obstacle_share(&self.sets.profile);
        if has_foreground {
            self.look.learn_floor();
        }
        let weights = self.sets.weigh(&self.free);
        if share > LARGEST_OBSTACLE_SHARE {
            return (Outlook::Seen(weights, Passage::Obstructed), Some(Trouble::FloorModelBroken));
        }
        let ends = self.free.iter().enumerate().rev();
        self.directions.extend(ends.filter_map(|(column, &free)| self.ground.end(column, free)));
        (Outlook::Seen(weights, self.passage()), None)
    }

    /// How far the floor is free by the last picture, from right to left; empty where something was wrong with it.
    #[must_use]
    pub fn directions(&self) -> &[FreeDirection] {
        &self.directions
    }

    /// The cells of the last picture with floor and obstacles in it.
    #[must_use]
    pub fn cells(&self) -> &Cells {
        self.look.marked()
    }

    /// Of each column from the left, the free cells from the bottom.
    #[must_use]
    pub fn free(&self) -> &[u32] {
        &self.free
    }

    /// Of each column, the cells that the robot's own way covers, and those whose intrusion is weighed.
    #[must_use]
    pub fn covered(&self) -> (&[u32], &[u32]) {
        (&self.way, &self.sets.profile)
    }

    /// The grid on the floor.
    #[must_use]
    pub fn ground(&self) -> &GroundGrid {
        &self.ground
    }

    /// Columns, rows, side.
    #[must_use]
    pub fn size(&self) -> GridSize {
        self.look.size()
    }

    /// The polarity, once the floor right before the robot has been floor.
    fn start(&mut self) -> Option<Polarity> {
        if !self.has_started {
            let tried = match self.polarity {
                Some(polarity) => &[polarity][..],
                None => &[Polarity::BrightFloor, Polarity::DarkFloor],
            };
            let found = tried.iter().find(|&&polarity| self.look.cells(polarity).is_foreground_free());
            self.polarity = Some(*found?);
            self.has_started = true;
        }
        self.polarity
    }

    fn passage(&self) -> Passage {
        let is_free = |covered: &[u32]| self.free.iter().zip(covered).all(|(free, covered)| free >= covered);
        if !is_free(&self.way) {
            Passage::Obstructed
        } else if !is_free(&self.spare) {
            Passage::Narrow
        } else {
            Passage::Open
        }
    }
}
