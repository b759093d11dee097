//! A simulated robot driven by one behavior that has a camera and odometry, in closed loop.

use yamabico_core::behavior::Plugin;
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{FrameHeader, Kind, Pose, Proposal};
use yamabico_core::testing::Bench;
use yamabico_sim::{CameraView, Renderer, Scene};

use crate::camera::{CAMERA, ODOMETRY, frame_header, odometry, render};

/// Period of the odometry, s; the behavior is called after each message.
pub const TICK_S: f64 = 0.02;
/// Period of the camera, ticks.
pub const TICKS_PER_FRAME: u64 = 5;
/// Acceleration limits of the drive, m/s^2 and rad/s^2.
const ACCELERATION: [f64; 2] = [0.5, 2.0];
/// Distance that the odometry reports for each meter driven, m.
const ODOMETRY_SCALE: f64 = 1.01;

/// Fault of the camera that frames show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Light {
    /// None: frames show the world.
    Normal,
    /// Every pixel has this gray level.
    Uniform(u8),
    /// A gray gradient without edges.
    Haze,
}

/// Properties of the simulated sensors.
#[derive(Clone, Copy, Debug)]
pub struct Sensors {
    /// Time from the capture of a frame to its arrival, ticks.
    pub latency_ticks: u64,
    /// Heading error of the odometry, rad per meter driven.
    pub drift_rad_per_m: f64,
}

/// A robot in its world, the behavior that drives it, and what the behavior proposed.
pub struct CameraDrive<B: Plugin> {
    /// The behavior.
    pub bench: Bench<B>,
    /// True pose.
    pub robot: Pose2,
    /// Pose by odometry, in a frame of its own.
    pub wheels: Pose2,
    /// Latest proposal.
    pub proposal: Proposal,
    /// Latest message on the behavior's output `pose`, if it has one.
    pub pose: Option<Pose>,
    /// Camera at the pose of the latest frame.
    pub view: CameraView,
    /// Image that arrived in the latest tick.
    pub image: Option<Vec<u8>>,
    /// Twist while the behavior does not propose to drive.
    pub fallback: Twist,
    /// If set, twist of a robot that is led, whatever the behavior proposes.
    pub led: Option<Twist>,
    /// Fault of the camera.
    pub light: Light,
    /// Factor applied to all gray levels.
    pub gain: f64,
    /// First column that is black.
    pub covered_from: usize,
    /// If set, odometry messages arrive.
    pub has_odometry: bool,
    sensors: Sensors,
    scene: Scene,
    renderer: Renderer,
    twist: Twist,
    in_transit: Vec<(u64, FrameHeader, Vec<u8>)>,
    tick: u64,
}

impl<B: Plugin> CameraDrive<B> {
    /// Places the robot of `view` into the scene, at rest.
    pub fn new(
        bench: Bench<B>,
        view: CameraView,
        scene: Scene,
        renderer: Renderer,
        sensors: Sensors,
    ) -> Self {
        Self {
            bench,
            robot: view.robot,
            wheels: Pose2::new(5.0, -3.0, 2.0),
            proposal: Proposal::default(),
            pose: None,
            view,
            image: None,
            fallback: Twist::ZERO,
            led: None,
            light: Light::Normal,
            gain: 1.0,
            covered_from: usize::MAX,
            has_odometry: true,
            sensors,
            scene,
            renderer,
            twist: Twist::ZERO,
            in_transit: Vec::new(),
            tick: 0,
        }
    }

    /// Returns the time since the start, s.
    pub fn now_s(&self) -> f64 {
        self.tick as f64 * TICK_S
    }

    /// Returns the twist of the robot.
    pub fn twist(&self) -> Twist {
        self.twist
    }

    /// Renders an image from the current pose, with the faults that are set.
    pub fn render(&mut self) -> Vec<u8> {
        self.view.robot = self.robot;
        let width = self.view.intrinsics.width as usize;
        let mut pixels = match self.light {
            Light::Normal => render(&mut self.renderer, &self.scene, &self.view),
            Light::Uniform(level) => vec![level; width * self.view.intrinsics.height as usize],
            Light::Haze => {
                let count = width * self.view.intrinsics.height as usize;
                (0..count).map(|i| 100 + (i % 256 / 8) as u8).collect()
            }
        };
        for (i, level) in pixels.iter_mut().enumerate() {
            let is_covered = i % width >= self.covered_from;
            *level = if is_covered { 0 } else { (f64::from(*level) * self.gain).round().min(255.0) as u8 };
        }
        pixels
    }

    /// Runs for a duration, s.
    pub fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / TICK_S).round() as u64 {
            self.step();
        }
    }

    /// Advances by one tick: camera, odometry, proposal, motion. Returns true if a frame arrived.
    pub fn step(&mut self) -> bool {
        if self.tick.is_multiple_of(TICKS_PER_FRAME) {
            let pixels = self.render();
            let header = frame_header(&self.view.intrinsics, self.now_s());
            self.in_transit.push((self.tick + self.sensors.latency_ticks, header, pixels));
        }
        let now_s = self.now_s();
        self.bench.at(now_s);
        self.image = None;
        for (_, header, pixels) in self.in_transit.extract_if(.., |(due, ..)| *due <= self.tick) {
            self.bench.feed(&CAMERA, &header, &pixels);
            self.image = Some(pixels);
        }
        if self.has_odometry {
            self.bench.feed(&ODOMETRY, &odometry(now_s, self.wheels, self.twist), &[]);
        }
        self.proposal = self.bench.propose();
        if B::OUTPUTS.iter().any(|output| output.name == "pose")
            && let Some((pose, _)) = self.bench.published::<Pose>("pose").pop()
        {
            self.pose = Some(pose);
        }
        self.advance();
        self.image.is_some()
    }

    /// Moves the robot with limited acceleration, and the odometry with its errors.
    fn advance(&mut self) {
        let is_drive = self.proposal.kind() == Some(Kind::Drive);
        let target = self.led.unwrap_or(if is_drive { self.proposal.twist } else { self.fallback });
        let ramp =
            |now: f64, target: f64, limit: f64| now + (target - now).clamp(-limit * TICK_S, limit * TICK_S);
        self.twist.linear = ramp(self.twist.linear, target.linear, ACCELERATION[0]);
        self.twist.angular = ramp(self.twist.angular, target.angular, ACCELERATION[1]);
        self.robot = self.robot.integrate(&self.twist, TICK_S);
        let drift = self.sensors.drift_rad_per_m * self.twist.linear;
        let measured = Twist::planar(ODOMETRY_SCALE * self.twist.linear, self.twist.angular + drift);
        self.wheels = self.wheels.integrate(&measured, TICK_S);
        self.tick += 1;
    }
}
