//! Paint, light and mirror images distinguished from things by their motion between pictures.
//!
//! Where the color of the floor ends, something stands there, or the floor only looks different: a patch of sunlight, a
//! sheet of paper, a lamp's mirror image. Points above the foot of a thing move as things do; those of a patch move as the
//! floor, or as if they lay below it.

use nalgebra::Point2;
use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_vision::floor_columns::FloorEnd;
use yamabico_vision::plane_motion::PictureJudge;
use yamabico_vision::plane_motion::motion_point::MotionPoint;
use yamabico_vision::plane_motion::sequential_test::PointClass;
use yamabico_vision::rolling_window::RollingWindow;

use super::hidden_fan::HiddenFan;

/// Side of a cell, m, and cells on each side of the window.
const CELL_M: f64 = 0.1;
const CELLS: usize = 64;
/// Points beside a column that count for it, px at a width of 256 px.
const BESIDE_PX: f64 = 10.0;
/// Rows above the end of the floor that may show the floor before it, px at a width of 256 px.
const FOOT_PX: f64 = 4.0;
/// Votes of a point that moves as the floor or a mirror image, and of one that moves as a thing; and their maximum in a picture.
const FLAT: f32 = 1.0;
const THING: f32 = -4.0;
const MAX_VOTES: f32 = 3.0;
/// Distance of the foot of a thing behind the end of the floor up to which it votes there, m.
const SAME_FOOT_M: f64 = 0.3;
/// Sum of votes from which a place is flat, its limits, and its change toward zero per second.
const IS_FLAT: f32 = 3.0;
const LIMITS: (f32, f32) = (-8.0, 8.0);
const FADE_PER_S: f32 = 0.15;
/// Standard deviation of the distance of a thing up to which its place counts, m.
const MAX_RANGE_SIGMA_M: f64 = 0.15;
/// Share of the points below the floor, among all that were decided lately, from which the floor is a mirror: other floors have at
/// most half of it. Share of the counts that a picture keeps, and the number of points that it takes to know.
const MIRROR_SHARE: f32 = 0.08;
const KEPT: f32 = 0.95;
const MIN_DECIDED: f32 = 50.0;
/// Depth of a thing around the foot of a point, m.
const DEPTH_M: f64 = 0.05;

/// Places whose look differs from the floor, and whether they are flat. Allocates when it is created and for its first
/// picture.
#[derive(Clone, Debug)]
pub(super) struct FloorMotion {
    judge: PictureJudge,
    scale: f64,
    window: RollingWindow,
    votes: Vec<f32>,
    /// Points that were decided lately, and those of them that lie below the floor.
    decided: f32,
    below: f32,
    /// Time of the last picture, s.
    last_s: Option<f64>,
}

impl FloorMotion {
    /// Creates the judge of a camera; `None` if its lens distorts or it stands on the floor.
    pub fn new(pinhole: &Pinhole, mount: Mount) -> Option<Self> {
        Some(Self {
            judge: PictureJudge::of_camera(pinhole, mount)?,
            scale: f64::from(pinhole.intrinsics().width) / 256.0,
            window: RollingWindow::new(CELLS, CELL_M),
            votes: vec![0.0; CELLS * CELLS],
            decided: 0.0,
            below: 0.0,
            last_s: None,
        })
    }

    /// Takes in a picture captured at `odometry` and the time `at_s` (s), in which the floor ends at `ends`; adds where its things
    /// hide the floor to `hidden`.
    pub fn look(
        &mut self,
        image: ImageView,
        odometry: Pose2,
        at_s: f64,
        ends: impl Iterator<Item = FloorEnd>,
        hidden: &mut HiddenFan,
    ) {
        let elapsed_s = at_s - self.last_s.replace(at_s).unwrap_or(at_s);
        self.window.advance(odometry.position(), |slot| self.votes[slot] = 0.0);
        let fade = FADE_PER_S * elapsed_s.clamp(0.0, 60.0) as f32;
        for votes in &mut self.votes {
            *votes -= votes.clamp(-fade, fade);
        }
        // A picture that cannot be judged says nothing, and one that shows no things does not show that there are none.
        if self.judge.judge(image, odometry, at_s).is_err() || !self.judge.shows_things() {
            return;
        }
        self.feet().for_each(|foot| hidden.hide(foot, DEPTH_M));
        let points = self.judge.points();
        let count =
            |classes: &[PointClass]| points.iter().filter(|point| classes.contains(&point.class)).count();
        let decided = count(&[PointClass::Floor, PointClass::Below, PointClass::Above]);
        self.decided = KEPT * self.decided + decided as f32;
        self.below = KEPT * self.below + count(&[PointClass::Below]) as f32;
        for end in ends {
            let votes: f32 = points.iter().map(|point| vote(point, &end, self.scale)).sum();
            if let Some(slot) = self.window.slot(odometry.transform_point(end.place)) {
                let sum = self.votes[slot] + votes.clamp(-MAX_VOTES, MAX_VOTES);
                self.votes[slot] = sum.clamp(LIMITS.0, LIMITS.1);
            }
        }
    }

    /// True if the floor is known not to mirror what stands on it.
    pub fn is_matt(&self) -> bool {
        self.decided > MIN_DECIDED && self.below < MIRROR_SHARE * self.decided
    }

    /// Places of things in the last picture within `range_m` of the camera, robot frame at the capture, m: along the ray
    /// around the foot of each point.
    pub fn things(&self, range_m: f64) -> impl Iterator<Item = Point2<f64>> {
        let camera = self.camera();
        let near = self.feet().filter(move |foot| (foot - camera).norm() < range_m);
        near.flat_map(move |foot| {
            let along = (foot - camera).normalize() * DEPTH_M;
            [foot - along, foot, foot + along]
        })
    }

    /// Places of points that move as floor in the last picture within `range_m` of the camera, robot frame at the capture, m; none if
    /// the picture does not tell floor from things.
    pub fn floor(&self, range_m: f64) -> impl Iterator<Item = Point2<f64>> {
        let camera = self.camera();
        let points = self.judge.points().iter().filter(|_| self.judge.shows_things());
        let on_floor = points.filter(|point| point.class == PointClass::Floor).map(|point| point.floor);
        on_floor.filter(move |floor| (floor - camera).norm() < range_m)
    }

    /// Feet of the things in the last picture, robot frame at the capture, m.
    fn feet(&self) -> impl Iterator<Item = Point2<f64>> {
        let is_known = |point: &&MotionPoint| {
            point.class == PointClass::Above && point.range_sigma_m < MAX_RANGE_SIGMA_M
        };
        self.judge.points().iter().filter(is_known).map(|point| point.foot)
    }

    fn camera(&self) -> Point2<f64> {
        self.judge.view().position().xy().into()
    }

    /// True if the floor at `place` (odometry frame, m) only looks different.
    pub fn is_flat(&self, place: Point2<f64>) -> bool {
        self.window.slot(place).is_some_and(|slot| self.votes[slot] >= IS_FLAT)
    }
}

/// Vote of a point on the stretch of a column that looks different.
fn vote(point: &MotionPoint, end: &FloorEnd, scale: f64) -> f32 {
    let [u, v] = [point.pixel.x, point.pixel.y].map(f64::from);
    let is_inside = (u - end.u).abs() < BESIDE_PX * scale
        && (end.rows[0] - FOOT_PX * scale..end.rows[1] - FOOT_PX * scale).contains(&v);
    match point.class {
        _ if !is_inside => 0.0,
        PointClass::Floor | PointClass::Below => FLAT,
        // A thing that stands farther away, on the patch or behind it, does not raise its border.
        PointClass::Above if is_farther(point, end) => 0.0,
        PointClass::Above => THING,
        PointClass::Moving | PointClass::Undecided => 0.0,
    }
}

/// True if the foot of a thing certainly lies farther away than the end of the floor.
fn is_farther(point: &MotionPoint, end: &FloorEnd) -> bool {
    let from_m = point.foot.coords.norm() - 2.0 * point.range_sigma_m;
    from_m > end.place.coords.norm() + SAME_FOOT_M
}

#[cfg(test)]
mod tests {
    use yamabico_core::camera::Intrinsics;
    use yamabico_vision::plane_motion::sequential_test::ClassCosts;

    use super::*;

    const END: FloorEnd = FloorEnd {
        place: Point2::new(1.5, 0.0),
        u: 100.0,
        rows: [120.0, 160.0],
        is_lone: false,
        is_darker: false,
    };

    fn point(class: PointClass, u: f32, v: f32) -> MotionPoint {
        MotionPoint {
            pixel: [u, v].into(),
            class,
            costs: ClassCosts { floor: 0.0, above: 0.0, below: 0.0, expected: 1.0 },
            floor: Point2::new(2.0, 0.0),
            foot: Point2::new(1.5, 0.0),
            range_sigma_m: 0.03,
            height_m: 0.2,
            height_sigma_m: 0.02,
        }
    }

    #[test]
    fn points_on_the_stretch_vote_and_others_do_not() {
        let vote = |class, u, v| vote(&point(class, u, v), &END, 1.0);
        assert_eq!(vote(PointClass::Floor, 104.0, 140.0), FLAT);
        assert_eq!(vote(PointClass::Below, 96.0, 118.0), FLAT, "its upper edge belongs to it");
        assert_eq!(vote(PointClass::Above, 100.0, 125.0), THING);
        let farther = MotionPoint { foot: Point2::new(1.9, 0.0), ..point(PointClass::Above, 100.0, 125.0) };
        assert_eq!(super::vote(&farther, &END, 1.0), 0.0, "a thing that stands on the patch");
        assert_eq!(vote(PointClass::Floor, 100.0, 159.0), 0.0, "the foot of a thing moves as the floor, too");
        assert_eq!(vote(PointClass::Floor, 115.0, 140.0), 0.0, "another column");
        assert_eq!(vote(PointClass::Moving, 100.0, 140.0), 0.0);
    }

    #[test]
    fn pictures_that_cannot_be_judged_say_nothing() {
        let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(256, 240, 1.1));
        let mut motion = FloorMotion::new(&pinhole, Mount::tilted(0.5, 0.15)).expect("usable");
        let pixels = vec![90_u8; 256 * 240];
        let image = ImageView::new(&pixels, 256, 240, 256).expect("an image");
        for i in 0..20 {
            let odometry = Pose2::new(0.04 * f64::from(i), 0.0, 0.0);
            let mut hidden = HiddenFan::new(Point2::origin());
            motion.look(image, odometry, 0.1 * f64::from(i), std::iter::once(END), &mut hidden);
            assert!(!motion.is_flat(odometry.transform_point(END.place)), "without texture nothing is known");
            assert!(motion.things(3.0).next().is_none() && !hidden.is_hidden(Point2::new(2.0, 0.0)));
        }
    }
}
