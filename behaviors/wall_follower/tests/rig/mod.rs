//! A robot with a camera in a rendered corridor, driven by the wall follower alone.

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Calibration, Intrinsics, Mount};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{FrameHeader, Kind, Odometry, Proposal};
use yamabico_core::sensor::SensorKind;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_core::time::Time;
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_wall_follower::{CAMERA, ODOMETRY, WallFollower};

/// Seconds between two readings of the odometry, each followed by a call of the behavior.
pub const TICK_S: f64 = 0.02;
/// Pictures are taken every so many ticks ...
const TICKS_PER_PICTURE: u64 = 5;
/// ... and arrive so many ticks later.
const LATENCY_TICKS: u64 = 3;

/// The camera of the tests: 60 degrees wide, 0.6 m above the floor, looking 5 degrees down.
pub fn camera(width: u32, height: u32) -> (Intrinsics, Mount) {
    let mount = Mount::tilted(0.6, 5_f64.to_radians());
    (Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians()), mount)
}

/// A robot with that camera in the behavior's slot.
pub fn setup(intrinsics: Intrinsics, mount: Mount, calibrated: Calibration) -> Setup {
    let mut setup = camera_setup(intrinsics, mount);
    if let SensorKind::Camera { calibrated: now, .. } = &mut setup.sensors[0].1.kind {
        *now = calibrated;
    }
    setup
}

/// The header of a gray picture of this camera.
pub fn frame_header(intrinsics: &Intrinsics, seconds: f64) -> FrameHeader {
    FrameHeader::gray(intrinsics.width, intrinsics.height, Time::from_secs_f64(seconds).0)
}

/// One picture of a corridor 2 m wide, seen from a pose.
#[allow(dead_code, reason = "each test uses its part")]
pub fn picture(intrinsics: Intrinsics, mount: Mount, robot: Pose2) -> Vec<u8> {
    let scene = Scene::new(&World::random_corridor(3, 2.0), 0).expect("a valid world");
    let mut pixels = vec![0; (intrinsics.width * intrinsics.height) as usize];
    Renderer::new(Photometry::default(), stream(3, "picture"))
        .render(&scene, &CameraView { intrinsics, mount, robot }, &mut pixels)
        .expect("a valid view");
    pixels
}

/// A drive: the robot in its world and what it was told.
#[allow(dead_code, reason = "each test uses its part")]
pub struct Drive {
    pub bench: Bench<WallFollower>,
    pub robot: Pose2,
    pub proposal: Proposal,
    scene: Scene,
    renderer: Renderer,
    view: CameraView,
    twist: Twist,
    wheels: Pose2,
    on_the_way: Vec<(u64, FrameHeader, Vec<u8>)>,
    tick: u64,
    /// Whether pictures are black.
    pub is_dark: bool,
}

#[allow(dead_code, reason = "each test uses its part")]
impl Drive {
    /// A robot at this pose of this world, with a picture of this size.
    pub fn new(world: &World, robot: Pose2, size: (u32, u32), toml: &str) -> Self {
        let (intrinsics, mount) = camera(size.0, size.1);
        Self {
            bench: Bench::new(toml, setup(intrinsics, mount, Calibration::Measured))
                .expect("a valid configuration"),
            robot,
            proposal: Proposal::default(),
            scene: Scene::new(world, 0).expect("a valid world"),
            renderer: Renderer::new(Photometry::default(), stream(7, "drive")),
            view: CameraView { intrinsics, mount, robot },
            twist: Twist::ZERO,
            wheels: Pose2::new(5.0, -3.0, 2.0),
            on_the_way: Vec::new(),
            tick: 0,
            is_dark: false,
        }
    }

    /// Seconds since the start.
    pub fn now_s(&self) -> f64 {
        self.tick as f64 * TICK_S
    }

    /// Moves on by one tick: picture, odometry, proposal, motion.
    pub fn step(&mut self) {
        if self.tick.is_multiple_of(TICKS_PER_PICTURE) {
            self.view.robot = self.robot;
            let intrinsics = &self.view.intrinsics;
            let mut pixels = vec![0; (intrinsics.width * intrinsics.height) as usize];
            if !self.is_dark {
                self.renderer.render(&self.scene, &self.view, &mut pixels).expect("a valid view");
            }
            let header = frame_header(intrinsics, self.now_s());
            self.on_the_way.push((self.tick + LATENCY_TICKS, header, pixels));
        }
        let now_s = self.now_s();
        self.bench.at(now_s);
        for (_, header, pixels) in self.on_the_way.extract_if(.., |(due, ..)| *due <= self.tick) {
            self.bench.feed(&CAMERA, &header, &pixels);
        }
        let odometry = Odometry::new(Time::from_secs_f64(now_s).0, &self.wheels, &self.twist);
        self.bench.feed(&ODOMETRY, &odometry, &[]);
        self.proposal = self.bench.propose();
        self.move_on();
    }

    /// Wheels with limited acceleration and a time constant; the odometry errs by 1 % and turns 0.3 degrees a meter too far.
    fn move_on(&mut self) {
        let wanted =
            if self.proposal.kind() == Some(Kind::Drive) { self.proposal.twist } else { Twist::ZERO };
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
