//! A robot with a camera that approaches an intersection in a rendered corridor.

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::Pose2;
use yamabico_core::testing::camera_setup;
use yamabico_intersection_tracker::IntersectionTracker;
use yamabico_intersection_tracker::finder::Side;
use yamabico_rigs::approach::{self, Ending, edge_column, wall_ends};
use yamabico_rigs::camera::forward_camera;
use yamabico_rigs::camera_drive::CameraDrive;
use yamabico_sim::World;

/// The robot of these tests.
pub type Drive = CameraDrive<IntersectionTracker>;

/// Returns the camera of the tests, `fov_deg` wide, 6 degrees down.
pub fn camera(width: u32, height: u32, fov_deg: f64) -> (Intrinsics, Mount) {
    forward_camera(width, height, fov_deg, 6.0)
}

/// Returns a robot with that camera in the behavior's slot.
pub fn setup((intrinsics, mount): (Intrinsics, Mount)) -> Setup {
    camera_setup(intrinsics, mount)
}

/// Places a robot into the world.
pub fn drive(world: &World, robot: Pose2, camera: (Intrinsics, Mount), noise: f32, seed: u64) -> Drive {
    approach::approach(world, robot, camera, noise, seed)
}

/// Returns the column at which an edge of the standard corridor is in the latest image, at the height of the camera, px.
pub fn true_column(drive: &Drive, side: Side) -> Option<f64> {
    let [left, right] = wall_ends(&approach::world(Ending::DeadEnd, 0.0));
    edge_column(&drive.view, if side == Side::Left { left } else { right })
}
