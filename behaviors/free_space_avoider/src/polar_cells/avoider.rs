//! The behavior with method `polar-cells`.

use nalgebra::Vector2;
use yamabico_core::behavior::{Inputs, Outputs, ParameterError, Setup};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{Axes, Axis, FreeDirection, FreeSpaceHeader, Proposal, Reason};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::time::Time;
use yamabico_vision::floor_color_file::ColorFile;

use super::destination::{Destination, Objective};
use super::overlay;
use super::pilot::{Maneuver, Pilot};
use super::ring_observer::{RingFailure, RingObserver};
use crate::config::Config;
use crate::echoes::Echoes;
use crate::{CAMERA, FREE_SPACE, GOAL, IMU, ODOMETRY, POSE, STALE_S};

/// Avoider that drives to a goal where the floor around the robot is free.
#[derive(Clone, Debug)]
pub struct PolarCellsAvoider {
    observer: RingObserver,
    pilot: Pilot,
    destination: Destination,
    odometry: OdometryTrack,
    echoes: Echoes,
    axes: Axes,
    last_frame: Option<Time>,
    failure: Option<RingFailure>,
    is_malformed: bool,
    directions: Vec<FreeDirection>,
    sequence: u64,
}

impl PolarCellsAvoider {
    /// Creates the behavior for a robot with a mirror camera and odometry.
    ///
    /// # Errors
    /// The camera is of another kind, there is no odometry, the mirror does not show the floor around the robot, the
    /// robot cannot accelerate, or the file with the floor's colors cannot be read.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, ParameterError> {
        let camera = setup.mirror_camera(&CAMERA)?;
        if setup.sensor(&ODOMETRY).is_none() {
            return Err(ParameterError::new(
                "inputs.odometry",
                "is missing, and method polar-cells needs the velocity of the robot",
            )
            .remedy("connect an odometry sensor: inputs.odometry = \"...\""));
        }
        let learned = match &config.floor_colors {
            Some(file) => Some(
                ColorFile::read(&setup.folder.join(file))
                    .map_err(|problem| ParameterError::new("floor_colors", problem))?,
            ),
            None => None,
        };
        let is_holonomic = setup.robot.axes.contains(Axis::Lateral);
        Ok(Self {
            observer: RingObserver::new(
                config,
                &camera.camera,
                &camera.mount,
                setup.robot.radius_m,
                learned,
            )?,
            pilot: Pilot::new(config, &setup.robot, &camera)?,
            destination: Destination::new(config.goal_m, config.tolerance_m),
            odometry: OdometryTrack::default(),
            echoes: Echoes::new(setup),
            axes: if is_holonomic { Axes::ALL } else { Axes::PLANAR },
            last_frame: None,
            failure: None,
            is_malformed: false,
            directions: Vec::with_capacity(config.directions as usize),
            sequence: 0,
        })
    }

    /// Processes the inputs and returns a proposal.
    pub fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        inputs.fresh(&IMU).for_each(|reading| {
            self.odometry.push_imu(reading.header, now);
        });
        inputs.fresh(&ODOMETRY).for_each(|reading| {
            self.odometry.push(reading.header, now);
        });
        self.echoes.update(inputs);
        inputs.fresh(&POSE).for_each(|pose| self.destination.take_pose(pose.header));
        inputs.fresh(&GOAL).for_each(|goal| self.destination.take_goal(goal.header));
        if inputs.is_fresh(&CAMERA) && self.process_frame(inputs, now) {
            self.publish(outputs);
            if let Some(frame) = inputs.latest(&CAMERA) {
                outputs.draw(&CAMERA, frame.header, |overlay| overlay::draw(overlay, &self.observer));
            }
        }
        let Some(stamp) = self.last_frame else {
            let reason = if self.is_malformed { Reason::MalformedInput } else { Reason::NoInput };
            return Proposal::abstain(reason);
        };
        let abstain = |reason| Proposal::abstain(reason).with_evidence(stamp);
        let Some(reading) = self.odometry.newest().copied() else { return abstain(Reason::NoInput) };
        if self.is_malformed {
            return abstain(Reason::MalformedInput);
        }
        let is_stale = |stamp: Time| now.seconds_after(stamp) > STALE_S;
        if is_stale(stamp) || is_stale(reading.stamp) || self.echoes.is_silent(now) {
            return abstain(Reason::StaleInput);
        }
        let poses = (self.odometry.pose_at(stamp), self.odometry.pose_at(now));
        let (Some(then), Some(robot)) = poses else { return abstain(Reason::NoInput) };
        self.proposal(&then, &robot, &reading.twist, now).with_evidence(stamp.min(reading.stamp))
    }

    /// Returns the observer of the floor, with the results of the last frame.
    #[must_use]
    pub fn observer(&self) -> &RingObserver {
        &self.observer
    }

    /// Processes the latest frame. Returns true if it is well-formed.
    fn process_frame(&mut self, inputs: &Inputs<'_>, now: Time) -> bool {
        let Some(frame) = inputs.latest(&CAMERA) else { return false };
        let stamp = Time(frame.header.stamp_ns);
        let size = self.observer.mirror().size();
        let image = frame.rgb(size).filter(|_| stamp.is_next(self.last_frame, now));
        self.is_malformed = image.is_none();
        let Some(image) = image else { return false };
        self.last_frame = Some(stamp);
        self.failure = self.observer.observe(image).err();
        self.echoes.place(&self.odometry, stamp);
        self.observer.bound(&self.echoes);
        true
    }

    fn publish(&mut self, outputs: &mut Outputs<'_>) {
        let Some(stamp) = self.last_frame.filter(|_| self.failure.is_none()) else { return };
        let header = FreeSpaceHeader { stamp_ns: stamp.0, evidence_ns: stamp.0, sequence: self.sequence };
        self.directions.clear();
        self.directions.extend(self.observer.distances().ends());
        // The output may have no subscriber; the drive does not depend on it.
        if outputs.publish(FREE_SPACE.name, &header, &self.directions).is_ok() {
            self.sequence += 1;
        }
    }

    /// Returns the proposal of a robot that was at `then` at the capture of the last frame and is at `robot` now.
    fn proposal(&mut self, then: &Pose2, robot: &Pose2, twist: &Twist, now: Time) -> Proposal {
        let stop = |reason| Proposal::drive(self.axes, Twist::ZERO).with_reason(reason);
        if let Some(failure) = self.failure {
            let stop = stop(failure.reason());
            return match failure {
                RingFailure::NoFloorAhead => {
                    stop.with_note(format_args!("no uniform floor color ahead at the start"))
                }
                RingFailure::MaskUnreliable => {
                    stop.with_note(format_args!("too little floor color around the robot"))
                }
                RingFailure::LowContrast => {
                    stop.with_note(format_args!("the robot's body has the floor's color"))
                }
                RingFailure::MirrorMoved { offset_px } => {
                    stop.with_note(format_args!("mirror {offset_px:.1} px off its calibrated center"))
                }
            };
        }
        let goal = match self.destination.objective(&self.odometry, robot) {
            Objective::Arrived => return stop(Reason::Nominal).with_note(format_args!("arrived")),
            Objective::Lost => return stop(Reason::Lost),
            Objective::Toward { direction_rad, distance_m } => (direction_rad, distance_m),
        };
        let moved = then.relative(robot);
        let drive = |twist: Twist| Proposal::drive(self.axes, twist);
        match self.pilot.steer(self.observer.distances(), &moved, twist, goal, now) {
            Maneuver::Drive { twist, share } => {
                drive(twist).with_note(format_args!("{:.0} % of the speed", 100.0 * share))
            }
            Maneuver::BackOut(twist) => drive(twist).with_note(format_args!("backing away from an obstacle")),
            Maneuver::Turn(turn_radps) => drive(Twist::planar(0.0, turn_radps))
                .uncoupled()
                .with_reason(Reason::Searching)
                .with_note(format_args!("turning toward free floor")),
            Maneuver::Wait { blocked_s } => {
                stop(Reason::Searching).with_note(format_args!("no free direction for {blocked_s:.1} s"))
            }
            Maneuver::Blocked { blocked_s } => {
                stop(Reason::PassageBlocked).with_note(format_args!("no free direction for {blocked_s:.0} s"))
            }
            Maneuver::Brake => Proposal::halt(self.axes, Reason::PassageBlocked)
                .with_note(format_args!("obstacle within the stopping distance")),
        }
    }
}

/// Returns the linear velocity of a twist, m/s.
pub(super) fn velocity(twist: &Twist) -> Vector2<f64> {
    Vector2::new(twist.linear, twist.lateral)
}
