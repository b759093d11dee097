//! Blocks seen ahead, remembered until the robot has driven over their place or a sensor has found it free.

use nalgebra::{Point2, Vector2};
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::{Mount, Pinhole};

use super::features::{BlockGrid, Blocks, Feature};
use super::learned::LearnedLook;

/// Maximum number of samples.
const CAPACITY: usize = 4096;
/// Distance from the robot's center up to which blocks are remembered, m.
const FARTHEST_M: f64 = 2.0;
/// Minimum motion between two images whose blocks are remembered, m and rad.
const MOTION: (f64, f64) = (0.1, 0.25);

/// A block seen on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sample {
    /// Place, odometry frame, m.
    place: Point2<f32>,
    feature: Feature,
}

/// Memory of blocks by their place on the floor. Allocates at its creation only.
#[derive(Clone, Debug)]
pub struct FloorSamples {
    grid: BlockGrid,
    /// Blocks near the robot, with their place on the floor in the body frame, m.
    near: Vec<(usize, Point2<f64>)>,
    samples: Vec<Sample>,
    /// Sample replaced next, once the memory is full.
    next: usize,
    last_pose: Option<Pose2>,
    is_color: bool,
}

impl FloorSamples {
    /// Creates the memory for a mounted camera.
    #[must_use]
    pub fn new(camera: &Pinhole, mount: &Mount) -> Self {
        let k = camera.intrinsics();
        let grid = BlockGrid::of(k.width as usize, k.height as usize);
        let place = |column: usize, row: usize| {
            let (u, v) = grid.center(column, row);
            let ray = camera.normalized_from_pixel(Vector2::new(u, v))?.push(1.0);
            let ray = mount.rotation_body_from_camera() * ray;
            let share = mount.z / -ray.z;
            let place = Point2::new(mount.x + share * ray.x, mount.y + share * ray.y);
            (share > 0.0 && place.coords.norm() < FARTHEST_M).then_some(place)
        };
        let blocks = (0..grid.rows).flat_map(|row| (0..grid.columns).map(move |column| (column, row)));
        let near = blocks.enumerate().filter_map(|(i, (column, row))| Some((i, place(column, row)?)));
        Self {
            grid,
            near: near.collect(),
            samples: Vec::with_capacity(CAPACITY),
            next: 0,
            last_pose: None,
            is_color: false,
        }
    }

    /// Remembers the near blocks of an image taken at this pose (odometry frame), unless the robot has hardly moved since the last
    /// one, or the image has another size.
    pub fn remember(&mut self, blocks: &Blocks, pose: &Pose2) {
        let has_moved = self.last_pose.is_none_or(|last| {
            let moved = last.inverse().compose(pose);
            moved.position().coords.norm() > MOTION.0 || moved.theta.abs() > MOTION.1
        });
        if !has_moved || blocks.grid() != self.grid {
            return;
        }
        self.last_pose = Some(*pose);
        if self.is_color != blocks.is_color() {
            self.samples.clear();
            self.is_color = blocks.is_color();
        }
        for &(block, place) in &self.near {
            if blocks.is_saturated()[block] {
                continue;
            }
            let place = pose.transform_point(place).cast::<f32>();
            let sample = Sample { place, feature: blocks.features()[block] };
            if self.samples.len() < CAPACITY {
                self.samples.push(sample);
            } else {
                self.next = (self.next + 1) % CAPACITY;
                self.samples[self.next] = sample;
            }
        }
    }

    /// Adds every remembered block whose place (odometry frame, m) `is_floor` to `look`, and forgets the block. Such places are
    /// covered by the robot's footprint, or lie in the free range of a sonar. Returns the number of
    /// blocks learned.
    pub fn confirm(&mut self, is_floor: impl Fn(Point2<f64>) -> bool, look: &mut LearnedLook) -> usize {
        let (mut i, mut learned) = (0, 0);
        while i < self.samples.len() {
            if is_floor(self.samples[i].place.cast()) {
                look.learn(&self.samples.swap_remove(i).feature, self.is_color);
                learned += 1;
            } else {
                i += 1;
            }
        }
        learned
    }

    /// Number of remembered blocks.
    #[must_use]
    pub fn count(&self) -> usize {
        self.samples.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor_appearance::features::Picture;
    use yamabico_geometry::camera::Intrinsics;
    use yamabico_geometry::image::ImageView;

    #[test]
    fn what_is_driven_over_is_learned() {
        let camera = Pinhole::ideal(Intrinsics::from_horizontal_fov(320, 240, 1.2));
        let mut samples = FloorSamples::new(&camera, &Mount::tilted(0.4, 0.4));
        let level = |v: usize| if v < 60 { 30 } else { 150 };
        let data: Vec<u8> = (0..320 * 240).map(|i| level(i / 320)).collect();
        let mut blocks = Blocks::default();
        blocks.measure(Picture::Gray(ImageView::new(&data, 320, 240, 320).unwrap()));
        let mut look = LearnedLook::default();
        samples.remember(&blocks, &Pose2::new(1.0, 2.0, 0.0));
        let seen = samples.count();
        samples.remember(&blocks, &Pose2::new(1.0, 2.01, 0.0));
        assert!(seen > 100 && samples.count() == seen, "at rest nothing is added");
        let circle =
            |center: Point2<f64>| move |place: Point2<f64>| nalgebra::distance(&place, &center) < 0.25;
        assert_eq!(samples.confirm(circle(Point2::new(1.0, 2.0)), &mut look), 0, "behind the camera's view");
        let learned = samples.confirm(circle(Point2::new(1.8, 2.0)), &mut look);
        assert!(learned > 10 && samples.count() == seen - learned);
        assert_eq!(look.modes().len(), 1);
        assert!((look.modes()[0].mean[2] - 158_f32.ln()).abs() < 0.02);
        for i in 0..100 {
            samples.remember(&blocks, &Pose2::new(f64::from(i), 0.0, 0.0));
        }
        assert_eq!(samples.count(), CAPACITY);
    }
}
