//! A robot with a camera that approaches an intersection in a rendered corridor.

#![allow(dead_code, reason = "each test uses its part")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use rand::RngExt;
use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{FrameHeader, Kind, Odometry, Proposal};
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_core::time::Time;
use yamabico_intersection_tracker::finder::Side;
use yamabico_intersection_tracker::landmarks::Landmarks;
use yamabico_intersection_tracker::{CAMERA, IntersectionTracker, ODOMETRY};
use yamabico_sim::random::stream;
use yamabico_sim::world::{Branch, Corridor, Side as WallSide};
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};

/// Seconds between two readings of the odometry, each followed by a call of the behavior.
pub const TICK_S: f64 = 0.02;
/// Pictures are taken every so many ticks ...
pub const TICKS_PER_PICTURE: u64 = 5;
/// ... and arrive so many ticks later.
pub const LATENCY_TICKS: u64 = 2;
/// Where the walls end, world x, meters.
pub const END_M: f64 = 12.0;

/// A camera of the tests: `fov_deg` wide, 0.6 m above the floor, looking 6 degrees down.
pub fn camera(width: u32, height: u32, fov_deg: f64) -> (Intrinsics, Mount) {
    let mount = Mount::tilted(0.6, 6_f64.to_radians());
    (Intrinsics::from_horizontal_fov(width, height, fov_deg.to_radians()), mount)
}

/// A robot with that camera in the behavior's slot.
pub fn setup((intrinsics, mount): (Intrinsics, Mount)) -> Setup {
    camera_setup(intrinsics, mount)
}

/// The header of a gray picture of this camera.
pub fn frame_header(intrinsics: &Intrinsics, seconds: f64) -> FrameHeader {
    FrameHeader::gray(intrinsics.width, intrinsics.height, Time::from_secs_f64(seconds).0)
}

/// A reading of the odometry.
pub fn odometry(seconds: f64, pose: Pose2, twist: Twist) -> Odometry {
    Odometry::new(Time::from_secs_f64(seconds).0, &pose, &twist)
}

/// How the corridor ends at [`END_M`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It crosses another corridor and goes on.
    Crossing,
    /// It meets another corridor across.
    Tee,
    /// A wall closes it.
    DeadEnd,
}

/// A corridor 2 m wide with another one of this width across at [`END_M`].
pub fn world(ending: Ending, across_m: f64) -> World {
    dressed(World::corridor(20.0, 2.0), ending, across_m)
}

/// The corridor of a seed, colors, lamps, floor and doors as they come, but for the last 1.5 m before its end.
pub fn random_world(seed: u64, ending: Ending) -> World {
    let mut rng = stream(seed, "approach");
    let mut world = World::random_corridor(seed, rng.random_range(1.7..2.4));
    world.boxes.clear();
    let corridor = world.corridor.as_mut().unwrap();
    corridor.doors.retain(|door| door.at_m + door.width_m < END_M - 1.5);
    dressed(world, ending, rng.random_range(1.6..3.0))
}

fn dressed(mut world: World, ending: Ending, across_m: f64) -> World {
    let corridor = world.corridor.as_mut().unwrap();
    let length_m = match ending {
        Ending::Crossing => END_M + across_m + 5.0,
        Ending::Tee => END_M + across_m + 0.101,
        Ending::DeadEnd => END_M,
    };
    *corridor = Corridor { length_m: length_m - corridor.start_x_m, ..corridor.clone() };
    if ending != Ending::DeadEnd {
        let branch = |side| Branch { side, at_m: END_M + 0.5 * across_m, width_m: across_m, depth_m: 5.0 };
        corridor.branches = vec![branch(WallSide::Left), branch(WallSide::Right)];
    }
    world
}

/// A drive: the robot in its world and what it was told.
pub struct Drive {
    pub bench: Bench<IntersectionTracker>,
    pub robot: Pose2,
    pub proposal: Proposal,
    pub view: CameraView,
    /// The picture of this tick, where one was taken.
    pub picture: Option<Vec<u8>>,
    /// The edges, world frame.
    pub truth: Landmarks,
    pub photometry: Photometry,
    /// What the robot does when the behavior does not drive.
    pub otherwise: Twist,
    /// Gray levels are made so much brighter or darker.
    pub gain: f64,
    /// From this column on pictures are black.
    pub covered_from: usize,
    /// Whether readings of the odometry arrive.
    pub has_odometry: bool,
    scene: Scene,
    renderer: Renderer,
    twist: Twist,
    pub wheels: Pose2,
    on_the_way: Vec<(u64, FrameHeader, Vec<u8>)>,
    tick: u64,
}

impl Drive {
    /// A robot at this pose of this world, with this camera.
    pub fn new(
        world: &World,
        robot: Pose2,
        camera: (Intrinsics, Mount),
        noise_sigma: f32,
        seed: u64,
    ) -> Self {
        let photometry = Photometry { noise_sigma, ..Photometry::default() };
        let half_m = 0.5 * world.corridor.as_ref().unwrap().width_m;
        let points = [[END_M, half_m].into(), [END_M, -half_m].into()];
        Self {
            bench: Bench::new("speed_mps = 0.4", setup(camera)).unwrap(),
            robot,
            proposal: Proposal::default(),
            view: CameraView { intrinsics: camera.0, mount: camera.1, robot },
            picture: None,
            truth: Landmarks::new(&Pose2::IDENTITY, points, Default::default()),
            photometry,
            otherwise: Twist::planar(0.4, 0.0),
            gain: 1.0,
            covered_from: usize::MAX,
            has_odometry: true,
            scene: Scene::new(world, 0).unwrap(),
            renderer: Renderer::new(photometry, stream(seed, "drive")),
            twist: Twist::ZERO,
            wheels: Pose2::new(5.0, -3.0, 2.0),
            on_the_way: Vec::new(),
            tick: 0,
        }
    }

    /// Seconds since the start.
    pub fn now_s(&self) -> f64 {
        self.tick as f64 * TICK_S
    }

    /// The column at which an edge is truly seen in the picture of this tick, at the camera's height, pixels.
    pub fn true_column(&self, side: Side) -> Option<f64> {
        let at =
            self.truth.expected(&self.view.robot, (side, 0.0), &self.view.mount, &self.view.intrinsics)?;
        Some(at.pixel.x)
    }

    /// Renders a picture from where the robot is.
    pub fn render(&mut self) -> Vec<u8> {
        self.view.robot = self.robot;
        let intrinsics = &self.view.intrinsics;
        let mut pixels = vec![0; (intrinsics.width * intrinsics.height) as usize];
        self.renderer.render(&self.scene, &self.view, &mut pixels).unwrap();
        for (i, level) in pixels.iter_mut().enumerate() {
            let is_covered = i % intrinsics.width as usize >= self.covered_from;
            *level = if is_covered { 0 } else { (f64::from(*level) * self.gain).round().min(255.0) as u8 };
        }
        pixels
    }

    /// Moves on by one tick: picture, odometry, proposal, motion. Returns whether a picture arrived.
    pub fn step(&mut self) -> bool {
        if self.tick.is_multiple_of(TICKS_PER_PICTURE) {
            let pixels = self.render();
            let header = frame_header(&self.view.intrinsics, self.now_s());
            self.on_the_way.push((self.tick + LATENCY_TICKS, header, pixels));
        }
        let now_s = self.now_s();
        self.bench.at(now_s);
        self.picture = None;
        for (_, header, pixels) in self.on_the_way.extract_if(.., |(due, ..)| *due <= self.tick) {
            self.bench.feed(&CAMERA, &header, &pixels);
            self.picture = Some(pixels);
        }
        if self.has_odometry {
            self.bench.feed(&ODOMETRY, &odometry(now_s, self.wheels, self.twist), &[]);
        }
        self.proposal = self.bench.propose();
        self.move_on();
        self.picture.is_some()
    }

    /// Wheels with limited acceleration; the odometry errs by 1 % and turns 0.3 degrees a meter too far.
    fn move_on(&mut self) {
        let is_drive = self.proposal.kind() == Some(Kind::Drive);
        let wanted = if is_drive { self.proposal.twist } else { self.otherwise };
        let towards =
            |now: f64, wanted: f64, most: f64| now + (wanted - now).clamp(-most * TICK_S, most * TICK_S);
        self.twist.linear = towards(self.twist.linear, wanted.linear, 0.5);
        self.twist.angular = towards(self.twist.angular, wanted.angular, 2.0);
        self.robot = self.robot.integrate(&self.twist, TICK_S);
        let drift = 0.3_f64.to_radians() * self.twist.linear;
        let measured = Twist::planar(1.01 * self.twist.linear, self.twist.angular + drift);
        self.wheels = self.wheels.integrate(&measured, TICK_S);
        self.tick += 1;
    }
}
