//! A robot with a camera in the rendered hallway, localized and driven by the map-localizer alone.

use std::path::PathBuf;

use yamabico_core::behavior::Setup;
use yamabico_core::camera::{Intrinsics, Mount};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{FrameHeader, Kind, Odometry, Pose, Proposal};
use yamabico_core::sensor::Robot;
use yamabico_core::testing::{Bench, camera_setup};
use yamabico_core::time::Time;
use yamabico_map_localizer::{CAMERA, MapLocalizer, ODOMETRY};
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};

/// Seconds between two readings of the odometry, each followed by a call of the behavior.
pub const TICK_S: f64 = 0.02;
/// Pictures are taken every so many ticks and arrive so many ticks later.
const TICKS: (u64, u64) = (5, 2);

/// The configurations' folder.
pub fn configs() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs"))
}

/// The hallway without people.
pub fn empty_hallway() -> World {
    let text = std::fs::read_to_string(configs().join("worlds/hallway.toml")).expect("the world file");
    World { people: Vec::new(), ..World::from_toml(&text).expect("a valid world") }
}

/// The camera of the tests: 60 degrees wide, 0.6 m above the floor, looking 6 degrees down.
pub fn camera(width: u32, height: u32) -> (Intrinsics, Mount) {
    let mount = Mount::tilted(0.6, 6_f64.to_radians());
    (Intrinsics::from_horizontal_fov(width, height, 60_f64.to_radians()), mount)
}

/// A robot of 0.2 m radius with that camera.
pub fn setup(width: u32, height: u32) -> Setup {
    let (intrinsics, mount) = camera(width, height);
    Setup {
        folder: configs(),
        robot: Robot { radius_m: 0.2, ..Robot::default() },
        ..camera_setup(intrinsics, mount)
    }
}

/// A configuration with the hallway's map, and more keys.
pub fn toml(more: &str) -> String {
    format!("map = \"maps/hallway.toml\"\n{more}")
}

/// The header of a gray picture of this camera.
pub fn frame_header(width: u32, height: u32, seconds: f64) -> FrameHeader {
    FrameHeader::gray(width, height, Time::from_secs_f64(seconds).0)
}

/// What the camera shows.
#[allow(dead_code, reason = "each test uses its part")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Light {
    /// The hallway.
    Normal,
    /// Nothing: dark, or covered.
    Dark,
    /// White everywhere.
    Saturated,
    /// A gray haze.
    Blurred,
}

/// A drive: the robot in its world and what it was told.
pub struct Drive {
    pub bench: Bench<MapLocalizer>,
    pub robot: Pose2,
    pub proposal: Proposal,
    pub pose: Option<Pose>,
    pub light: Light,
    pub wheels: Pose2,
    scene: Scene,
    renderer: Renderer,
    view: CameraView,
    twist: Twist,
    on_the_way: Vec<(u64, FrameHeader, Vec<u8>)>,
    tick: u64,
}

#[allow(dead_code, reason = "each test uses its part")]
impl Drive {
    /// A robot at this pose of the empty hallway.
    pub fn new(robot: Pose2, more: &str) -> Self {
        let (intrinsics, mount) = camera(256, 240);
        Self {
            bench: Bench::new(&toml(more), setup(256, 240)).expect("a valid configuration"),
            robot,
            proposal: Proposal::default(),
            pose: None,
            light: Light::Normal,
            wheels: Pose2::new(5.0, -3.0, 2.0),
            scene: Scene::new(&empty_hallway(), 0).expect("a valid world"),
            renderer: Renderer::new(Photometry::default(), stream(7, "drive")),
            view: CameraView { intrinsics, mount, robot },
            twist: Twist::ZERO,
            on_the_way: Vec::new(),
            tick: 0,
        }
    }

    pub fn now_s(&self) -> f64 {
        self.tick as f64 * TICK_S
    }

    /// Position and heading error of the published pose, m and rad.
    pub fn error(&self) -> (f64, f64) {
        let pose = self.pose.expect("a pose");
        let pose = Pose2::new(pose.x, pose.y, pose.theta);
        // The pose was published before the robot moved on.
        let truth = self.robot.integrate(&self.twist, -TICK_S);
        (pose.distance(&truth), yamabico_core::geometry::angle_difference(pose.theta, truth.theta).abs())
    }

    pub fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / TICK_S).round() as u64 {
            self.step();
        }
    }

    /// Moves on by one tick: picture, odometry, proposal, motion.
    pub fn step(&mut self) {
        if self.tick.is_multiple_of(TICKS.0) {
            self.take_picture();
        }
        let now_s = self.now_s();
        self.bench.at(now_s);
        for (_, header, pixels) in self.on_the_way.extract_if(.., |(due, ..)| *due <= self.tick) {
            self.bench.feed(&CAMERA, &header, &pixels);
        }
        let odometry = Odometry::new(Time::from_secs_f64(now_s).0, &self.wheels, &self.twist);
        self.bench.feed(&ODOMETRY, &odometry, &[]);
        self.proposal = self.bench.propose();
        if let Some((pose, _)) = self.bench.published::<Pose>("pose").pop() {
            self.pose = Some(pose);
        }
        self.move_on();
    }

    fn take_picture(&mut self) {
        self.view.robot = self.robot;
        let (width, height) = (self.view.intrinsics.width, self.view.intrinsics.height);
        let mut pixels = vec![0; (width * height) as usize];
        match self.light {
            Light::Normal => {
                self.renderer.render(&self.scene, &self.view, &mut pixels).expect("a valid view");
            }
            Light::Dark => pixels.fill(1),
            Light::Saturated => pixels.fill(255),
            Light::Blurred => {
                for (i, pixel) in pixels.iter_mut().enumerate() {
                    *pixel = 100 + (i % 256 / 8) as u8;
                }
            }
        }
        self.on_the_way.push((self.tick + TICKS.1, frame_header(width, height, self.now_s()), pixels));
    }

    /// Wheels with limited acceleration; the odometry errs by 1 % and turns 0.5 degrees a meter too far.
    fn move_on(&mut self) {
        let wanted =
            if self.proposal.kind() == Some(Kind::Drive) { self.proposal.twist } else { Twist::ZERO };
        let towards =
            |now: f64, wanted: f64, most: f64| now + (wanted - now).clamp(-most * TICK_S, most * TICK_S);
        self.twist.linear = towards(self.twist.linear, wanted.linear, 0.5);
        self.twist.angular = towards(self.twist.angular, wanted.angular, 2.0);
        self.robot = self.robot.integrate(&self.twist, TICK_S);
        let drift = 0.5_f64.to_radians() * self.twist.linear;
        let measured = Twist::planar(1.01 * self.twist.linear, self.twist.angular + drift);
        self.wheels = self.wheels.integrate(&measured, TICK_S);
        self.tick += 1;
    }
}
