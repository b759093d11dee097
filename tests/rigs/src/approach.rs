//! Corridors that end in a crossing, a T-junction or a wall, and the approach of a robot to their end.

use nalgebra::{Point2, Vector3};
use rand::RngExt;
use yamabico_core::behavior::Plugin;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_sim::random::stream;
use yamabico_sim::world::{Branch, Corridor, Side};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};

use crate::camera_drive::{CameraDrive, Sensors};

/// End of both walls, world x, m.
pub const END_M: f64 = 12.0;

/// End of a corridor at [`END_M`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// A crossing with another corridor.
    Crossing,
    /// A T-junction with another corridor.
    Tee,
    /// A wall.
    DeadEnd,
}

/// Returns a corridor 2 m wide that meets another one, `across_m` wide, at [`END_M`].
#[must_use]
pub fn world(ending: Ending, across_m: f64) -> World {
    with_ending(World::corridor(20.0, 2.0), ending, across_m)
}

/// Returns the corridor of a seed: colors, lamps, floor and doors vary, but no door is within 1.5 m of the end.
#[must_use]
pub fn random_world(seed: u64, ending: Ending) -> World {
    let mut rng = stream(seed, "approach");
    let mut world = World::random_corridor(seed, rng.random_range(1.7..2.4));
    world.boxes.clear();
    corridor(&mut world).doors.retain(|door| door.at_m + door.width_m < END_M - 1.5);
    with_ending(world, ending, rng.random_range(1.6..3.0))
}

fn with_ending(mut world: World, ending: Ending, across_m: f64) -> World {
    let corridor = corridor(&mut world);
    let length_m = match ending {
        Ending::Crossing => END_M + across_m + 5.0,
        Ending::Tee => END_M + across_m + 0.101,
        Ending::DeadEnd => END_M,
    };
    *corridor = Corridor { length_m: length_m - corridor.start_x_m, ..corridor.clone() };
    if ending != Ending::DeadEnd {
        let branch = |side| Branch { side, at_m: END_M + 0.5 * across_m, width_m: across_m, depth_m: 5.0 };
        corridor.branches = vec![branch(Side::Left), branch(Side::Right)];
    }
    world
}

fn corridor(world: &mut World) -> &mut Corridor {
    world.corridor.as_mut().expect("a world with a corridor")
}

/// Places a robot with a forward camera into the world; it goes straight at 0.4 m/s while the behavior does not drive.
///
/// # Panics
/// If the world has no corridor, or the behavior refuses the camera.
#[must_use]
pub fn approach<B: Plugin>(
    world: &World,
    robot: Pose2,
    (intrinsics, mount): (Intrinsics, Mount),
    noise_sigma: f32,
    seed: u64,
) -> CameraDrive<B> {
    let bench = Bench::new("speed_mps = 0.4", camera_setup(intrinsics, mount));
    let bench = bench.unwrap_or_else(|error| panic!("{error}"));
    let photometry = Photometry { noise_sigma, ..Photometry::default() };
    let mut drive = CameraDrive::new(
        bench,
        CameraView { intrinsics, mount, robot },
        Scene::new(world, 0).expect("a valid world"),
        Renderer::new(photometry, stream(seed, "drive")),
        Sensors { latency_ticks: 2, drift_rad_per_m: 0.3_f64.to_radians() },
    );
    drive.fallback = Twist::planar(0.4, 0.0);
    drive
}

/// Returns the corners at which the left and the right wall end, world frame.
///
/// # Panics
/// If the world has no corridor.
#[must_use]
pub fn wall_ends(world: &World) -> [Point2<f64>; 2] {
    let half_m = 0.5 * world.corridor.as_ref().expect("a world with a corridor").width_m;
    [[END_M, half_m].into(), [END_M, -half_m].into()]
}

/// Returns the image column of a vertical edge at the height of the camera, px; `None` behind the camera.
#[must_use]
pub fn edge_column(view: &CameraView, edge_in_world: Point2<f64>) -> Option<f64> {
    let point = view.robot.inverse().transform_point(edge_in_world);
    let camera_from_body = view.mount.rotation_body_from_camera().transpose();
    let in_camera = camera_from_body * Vector3::new(point.x - view.mount.x, point.y - view.mount.y, 0.0);
    let is_ahead = in_camera.z >= 0.1 && in_camera.z.is_finite();
    is_ahead.then(|| view.intrinsics.pixel_from_normalized(in_camera.xy() / in_camera.z).x)
}
