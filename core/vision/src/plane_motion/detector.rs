//! Plane motion with a memory: judged points as evidence on a grid, and tracks of walkers.

use nalgebra::{Point2, Vector2};
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Intrinsics, Mount};
use yamabico_geometry::image::ImageView;

use super::direct_alignment::Alignment;
use super::evidence_grid::{EvidenceGrid, OCCUPIED};
use super::grid_obstacles::{GridObstacle, ObstacleFinder};
use super::log_odds::CellRules;
use super::motion_point::MotionPoint;
use super::movers::{Mover, MoverTracker};
use super::picture_judge::{NotJudged, PictureJudge};

/// A [`PictureJudge`] with its own grid and tracks, for behaviors that keep none. Allocates for its first pictures only.
#[derive(Clone, Debug)]
pub struct PlaneMotion {
    judge: PictureJudge,
    grid: EvidenceGrid,
    obstacles: ObstacleFinder,
    movers: MoverTracker,
    /// Time of the last picture, s.
    looked_s: Option<f64>,
}

impl PlaneMotion {
    /// Creates a detector for undistorted images of this camera, which must look at the floor ahead.
    #[must_use]
    pub fn new(intrinsics: Intrinsics, mount: Mount) -> Self {
        let judge = PictureJudge::new(intrinsics, mount);
        Self {
            grid: EvidenceGrid::new(CellRules::default()),
            obstacles: ObstacleFinder::default(),
            movers: MoverTracker::new(*judge.view()),
            looked_s: None,
            judge,
        }
    }

    /// Judges a picture taken at `odometry` and the time `at_s` (s), and adds its evidence to the grid.
    ///
    /// # Errors
    /// [`NotJudged`]; the grid then only fades.
    pub fn look(
        &mut self,
        image: ImageView,
        odometry: Pose2,
        at_s: f64,
    ) -> Result<&[MotionPoint], NotJudged> {
        let judged = self.judge.judge(image, odometry, at_s).map(|_| ());
        if judged != Err(NotJudged::NoFeatures) {
            let before = self.looked_s.replace(at_s).unwrap_or(at_s);
            self.grid.advance(Vector2::new(odometry.x, odometry.y), at_s - before);
        }
        if judged.is_ok() {
            let pose = self.judge.pose();
            self.grid.add_points(self.judge.points(), self.judge.view().position().xy().into(), &pose);
            self.movers.update(self.judge.points(), &pose, at_s);
        }
        self.grid.smooth();
        judged.map(|()| self.judge.points())
    }

    /// Judge of the pictures.
    #[must_use]
    pub fn judge(&self) -> &PictureJudge {
        &self.judge
    }

    /// Points of the last picture; none if it was not judged.
    #[must_use]
    pub fn points(&self) -> &[MotionPoint] {
        self.judge.points()
    }

    /// Alignment with the longest baseline of the last picture.
    #[must_use]
    pub fn alignment(&self) -> Option<&Alignment> {
        self.judge.alignment()
    }

    /// Evidence around the robot, odometry frame.
    #[must_use]
    pub fn grid(&self) -> &EvidenceGrid {
        &self.grid
    }

    /// Evidence around the robot, for the votes of other sensors.
    pub fn grid_mut(&mut self) -> &mut EvidenceGrid {
        &mut self.grid
    }

    /// Finds the things on the grid as of the last picture, for a robot at `odometry`, from the cells at `counted`
    /// places (odometry frame). The nearest comes first.
    pub fn obstacles(&mut self, odometry: &Pose2, counted: impl Fn(Point2<f64>) -> bool) -> &[GridObstacle] {
        let turn_sigma = self.alignment().map_or(0.0, |alignment| alignment.covariance[(2, 2)].sqrt());
        self.obstacles.find(&self.grid, odometry, OCCUPIED, turn_sigma, counted)
    }

    /// Tracks of things that may walk, odometry frame; see [`Mover::is_confirmed`].
    #[must_use]
    pub fn movers(&self) -> &[Mover] {
        self.movers.tracks()
    }

    /// Forgets all pictures and all evidence.
    pub fn clear(&mut self) {
        self.judge.clear();
        self.grid.clear();
        self.movers.clear();
        self.looked_s = None;
    }
}
