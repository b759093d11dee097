//! Reach of the floor to both sides, by the motion between pictures: no wall stands before its end.
//!
//! Joints between planks, edges of carpets and of sunlight run along a corridor as the foot of a wall does, and may be
//! longer and of more contrast. But beyond a joint the floor goes on, and its points move as floor does.

use nalgebra::Point2;
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_vision::plane_motion::PictureJudge;
use yamabico_vision::plane_motion::motion_point::MotionPoint;
use yamabico_vision::plane_motion::sequential_test::PointClass;
use yamabico_vision::rolling_window::RollingWindow;

/// Side of a cell, m, and cells on each side of the window.
const CELL_M: f64 = 0.1;
const CELLS: usize = 64;
/// Votes of a point that moves as floor, as a thing, and as neither; their limits; and the sum from which a cell is floor, or a
/// thing.
const FLOOR: f32 = 1.0;
const THING: f32 = -2.0;
const NEITHER: f32 = -1.0;
const LIMITS: (f32, f32) = (-6.0, 6.0);
const IS_FLOOR: f32 = 3.0;
const IS_THING: f32 = -2.0;
/// Distance of the points that count, m: farther ones say little about their height.
const RANGE_M: f64 = 2.8;
/// Length of floor beside the robot that shows that there is no wall, m: more than a door is wide. Cells in it that nothing is known of.
const STRETCH_M: f64 = 1.3;
const MAX_UNKNOWN: usize = 2;
/// Stretch of the corridor that is looked at, m, behind and ahead of the robot, and to each side.
const ALONG_M: (f64, f64) = (-1.5, 2.6);
const ASIDE_M: f64 = 2.0;
/// Way between two pictures above which the odometry has begun anew, and what is known of places no longer holds, m.
const JUMP_M: f64 = 1.0;
/// Distance from the middle of the outermost floor at which a wall may stand, m: the wall's own cell may be half floor.
const TOLERANCE_M: f64 = 0.12;

/// Floor around the robot, odometry frame. Allocates when it is created and for its first picture.
#[derive(Clone, Debug)]
pub(crate) struct FloorReach {
    judge: PictureJudge,
    window: RollingWindow,
    votes: Vec<f32>,
    /// Odometry at the last picture.
    last: Option<Pose2>,
}

impl FloorReach {
    /// Creates it for a camera; `None` if its lens distorts or its height is unknown.
    pub fn new(pinhole: &Pinhole, mount: Mount) -> Option<Self> {
        Some(Self {
            judge: PictureJudge::of_camera(pinhole, mount)?,
            window: RollingWindow::new(CELLS, CELL_M),
            votes: vec![0.0; CELLS * CELLS],
            last: None,
        })
    }

    /// Takes in a picture captured at `odometry` and the time `at_s` (s).
    pub fn look(&mut self, image: ImageView<'_>, odometry: Pose2, at_s: f64) {
        if self.last.replace(odometry).is_some_and(|last| last.distance(&odometry) > JUMP_M) {
            self.votes.fill(0.0);
        }
        self.window.advance(odometry.position(), |slot| self.votes[slot] = 0.0);
        if self.judge.judge(image, odometry, at_s).is_ok() && self.judge.shows_things() {
            add(&mut self.votes, &self.window, self.judge.points(), &odometry);
        }
    }

    /// Distances from a robot at `odometry`, whose heading in the corridor is `heading` (rad, positive left), up to which no wall
    /// stands on its left and right, m; zero where nothing is known.
    pub fn reach_m(&self, odometry: &Pose2, heading: f64) -> [f64; 2] {
        let along = Pose2::new(odometry.x, odometry.y, odometry.theta - heading);
        [1.0, -1.0].map(|side| {
            let strips = (1..=(ASIDE_M / CELL_M) as usize).rev().map(|strip| strip as f64 * CELL_M);
            let outermost = strips.into_iter().find(|&aside_m| self.is_floor_along(&along, side * aside_m));
            outermost.map_or(0.0, |aside_m| (aside_m - TOLERANCE_M).max(0.0))
        })
    }

    /// True if a long stretch `aside_m` to the left of a line is floor.
    fn is_floor_along(&self, line: &Pose2, aside_m: f64) -> bool {
        let (mut floor, mut unknown) = (0, 0);
        let steps = ((ALONG_M.1 - ALONG_M.0) / CELL_M) as usize;
        for step in 0..steps {
            let place = Point2::new(ALONG_M.0 + step as f64 * CELL_M, aside_m);
            let slot = self.window.slot(line.transform_point(place));
            let votes = slot.map_or(0.0, |slot| self.votes[slot]);
            if votes >= IS_FLOOR {
                (floor, unknown) = (floor + 1, 0);
                if floor as f64 * CELL_M >= STRETCH_M {
                    return true;
                }
            } else if votes > IS_THING && unknown < MAX_UNKNOWN {
                unknown += 1;
            } else {
                (floor, unknown) = (0, 0);
            }
        }
        false
    }
}

/// Adds the points of a picture taken at `odometry` to the votes of their places on the floor.
fn add(votes: &mut [f32], window: &RollingWindow, points: &[MotionPoint], odometry: &Pose2) {
    for point in points {
        let vote = match point.class {
            PointClass::Floor => FLOOR,
            PointClass::Above => THING,
            PointClass::Moving => NEITHER,
            PointClass::Below | PointClass::Undecided => continue,
        };
        let is_near = point.floor.coords.norm() < RANGE_M;
        if let Some(slot) = window.slot(odometry.transform_point(point.floor)).filter(|_| is_near) {
            votes[slot] = (votes[slot] + vote).clamp(LIMITS.0, LIMITS.1);
        }
    }
}

#[cfg(test)]
mod tests {
    use yamabico_core::camera::Intrinsics;
    use yamabico_vision::plane_motion::sequential_test::ClassCosts;

    use super::*;

    /// Floor reach of a robot at `at` after some pictures with points of a class, from `along.0` to `along.1` (m) and at `aside_m`,
    /// in the frame of a corridor that is turned by 0.3 rad in the odometry frame.
    fn reach(shown: &[(PointClass, (f64, f64), f64)], at: Pose2) -> [f64; 2] {
        let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(256, 240, 1.0));
        let mut floor = FloorReach::new(&pinhole, Mount::tilted(0.6, 0.1)).expect("usable");
        let corridor = Pose2::new(0.0, 0.0, 0.3);
        for _ in 0..4 {
            for &(class, along_m, aside_m) in shown {
                let steps = ((along_m.1 - along_m.0) / 0.05) as usize;
                let points: Vec<MotionPoint> = (0..=steps)
                    .map(|step| point(class, Point2::new(along_m.0 + 0.05 * step as f64, aside_m)))
                    .collect();
                add(&mut floor.votes, &floor.window, &points, &corridor);
            }
        }
        floor.reach_m(&(corridor * at), at.theta)
    }

    fn point(class: PointClass, floor: Point2<f64>) -> MotionPoint {
        MotionPoint {
            pixel: [0.0, 0.0].into(),
            class,
            costs: ClassCosts { floor: 0.0, above: 0.0, below: 0.0, expected: 1.0 },
            floor,
            foot: floor,
            range_sigma_m: 0.03,
            height_m: 0.0,
            height_sigma_m: 0.02,
        }
    }

    #[test]
    fn floor_beyond_a_joint_shows_that_it_is_no_wall() {
        let floor = |aside_m: f64| (PointClass::Floor, (0.9, 2.5), aside_m);
        let shown: Vec<_> = (-4..=12).map(|cell| floor(0.05 * f64::from(cell))).collect();
        let [left_m, right_m] = reach(&shown, Pose2::default());
        assert!((0.4..0.6).contains(&left_m) && (0.0..0.2).contains(&right_m), "{left_m} {right_m}");
        let [left_m, right_m] = reach(&shown, Pose2::new(0.4, 0.2, -0.4));
        assert!((0.2..0.4).contains(&left_m) && (0.2..0.4).contains(&right_m), "{left_m} {right_m}");
        assert_eq!(reach(&[], Pose2::default()), [0.0; 2], "nothing is known");
    }

    #[test]
    fn odometry_that_begins_anew_forgets_what_was_floor() {
        let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(256, 240, 1.0));
        let mut floor = FloorReach::new(&pinhole, Mount::tilted(0.6, 0.1)).expect("usable");
        let pixels = vec![90_u8; 256 * 240];
        let image = ImageView::new(&pixels, 256, 240, 256).expect("an image");
        let look =
            |floor: &mut FloorReach, x: f64, at_s: f64| floor.look(image, Pose2::new(x, 0.0, 0.0), at_s);
        look(&mut floor, 0.0, 0.0);
        floor.votes.fill(LIMITS.1);
        look(&mut floor, 0.3, 0.1);
        assert!(floor.reach_m(&Pose2::new(0.3, 0.0, 0.0), 0.0)[0] > 1.0);
        look(&mut floor, 1.5, 0.2);
        assert_eq!(floor.reach_m(&Pose2::new(1.5, 0.0, 0.0), 0.0), [0.0; 2]);
    }

    #[test]
    fn floor_behind_an_open_door_does_not_move_the_wall() {
        let strips = |class, along_m, from: i32| {
            (from..from + 6).map(move |cell| (class, along_m, 0.05 * f64::from(cell)))
        };
        let corridor = strips(PointClass::Floor, (0.5, 2.5), 2);
        let room = strips(PointClass::Floor, (1.2, 2.1), 10);
        let alone: Vec<_> = corridor.clone().chain(room).collect();
        assert!(reach(&alone, Pose2::default())[0] < 0.4);
        let beyond = strips(PointClass::Floor, (0.5, 2.5), 10);
        let wall = strips(PointClass::Above, (0.5, 2.5), 10);
        let behind_wall: Vec<_> = corridor.chain(beyond).chain(wall).collect();
        assert!(reach(&behind_wall, Pose2::default())[0] < 0.4, "what stands there outweighs it");
    }
}
