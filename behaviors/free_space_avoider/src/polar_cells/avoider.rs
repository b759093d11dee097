//! The behavior with polar cells: looks all around, chooses a direction and proposes.

use nalgebra::Vector2;
use yamabico_core::behavior::{BuildError, Inputs, Outputs, Setup};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{Axes, Axis, FreeDirection, FreeSpaceHeader, Proposal, Reason};
use yamabico_core::odometry_track::{FUTURE_TOLERANCE_S, OdometryTrack};
use yamabico_core::time::Time;
use yamabico_vision::floor_color_file::ColorFile;

use super::destination::{Destination, Wish};
use super::pilot::{Pilot, Steer};
use super::sight::{RingSight, Trouble};
use crate::config::Config;
use crate::{CAMERA, FREE_SPACE, GOAL, ODOMETRY, POSE, STALE_S};

/// Drives where the floor is free all around.
#[derive(Clone, Debug)]
pub struct PolarCellsAvoider {
    sight: RingSight,
    pilot: Pilot,
    destination: Destination,
    odometry: OdometryTrack,
    axes: Axes,
    last_picture: Option<Time>,
    trouble: Option<Trouble>,
    malformed: bool,
    directions: Vec<FreeDirection>,
    published: u64,
}

impl PolarCellsAvoider {
    /// The behavior for a robot with a mirror camera and odometry.
    ///
    /// # Errors
    /// Another kind of camera, no odometry, a mirror that does not show the floor around the robot, or a file of colors that
    /// cannot be read.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, BuildError> {
        let camera = setup.mirror_camera(&CAMERA)?;
        if setup.sensor(&ODOMETRY).is_none() {
            return Err(BuildError::new(
                "inputs.odometry",
                "polar-cells needs odometry: it drives by its velocity",
            ));
        }
        let learned = match &config.floor_colors {
            Some(file) => Some(
                ColorFile::read(&setup.folder.join(file))
                    .map_err(|problem| BuildError::new("floor_colors", problem))?,
            ),
            None => None,
        };
        let is_holonomic = setup.robot.axes.contains(Axis::Lateral);
        Ok(Self {
            sight: RingSight::new(config, &camera.camera, &camera.mount, setup.robot.radius_m, learned)?,
            pilot: Pilot::new(config, &setup.robot, &camera)?,
            destination: Destination::new(config.goal_m, config.tolerance_m),
            odometry: OdometryTrack::default(),
            axes: if is_holonomic { Axes::ALL } else { Axes::PLANAR },
            last_picture: None,
            trouble: None,
            malformed: false,
            directions: Vec::with_capacity(config.directions as usize),
            published: 0,
        })
    }

    /// Looks at the inputs once and proposes.
    pub fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        inputs.fresh(&ODOMETRY).for_each(|reading| {
            self.odometry.push(reading.header, now);
        });
        inputs.fresh(&POSE).for_each(|pose| self.destination.take_pose(pose.header));
        inputs.fresh(&GOAL).for_each(|goal| self.destination.take_goal(goal.header));
        if inputs.is_fresh(&CAMERA) && self.look(inputs, now) {
            self.publish(outputs);
        }
        let Some(stamp) = self.last_picture else {
            let reason = if self.malformed { Reason::MalformedInput } else { Reason::NoInput };
            return Proposal::abstain(reason);
        };
        let abstain = |reason| Proposal::abstain(reason).with_evidence(stamp);
        let Some(moving) = self.odometry.newest().copied() else { return abstain(Reason::NoInput) };
        if self.malformed {
            return abstain(Reason::MalformedInput);
        }
        if now.seconds_after(stamp) > STALE_S || now.seconds_after(moving.stamp) > STALE_S {
            return abstain(Reason::StaleInput);
        }
        let poses = (self.odometry.pose_at(stamp), self.odometry.pose_at(now));
        let (Some(then), Some(robot)) = poses else { return abstain(Reason::NoInput) };
        self.proposal(&then, &robot, &moving.twist, now).with_evidence(stamp.min(moving.stamp))
    }

    /// What it sees.
    #[must_use]
    pub fn sight(&self) -> &RingSight {
        &self.sight
    }

    /// How it chooses.
    #[must_use]
    pub fn pilot(&self) -> &Pilot {
        &self.pilot
    }

    /// Whether a picture came that was as pictures of the camera are.
    fn look(&mut self, inputs: &Inputs<'_>, now: Time) -> bool {
        let Some(frame) = inputs.latest(&CAMERA) else { return false };
        let stamp = Time(frame.header.stamp_ns);
        let is_newer = self.last_picture.is_none_or(|last| stamp > last);
        let size = self.sight.image().size();
        let picture = frame.rgb(size).filter(|_| is_newer && stamp.seconds_after(now) <= FUTURE_TOLERANCE_S);
        self.malformed = picture.is_none();
        let Some(picture) = picture else { return false };
        self.last_picture = Some(stamp);
        self.trouble = self.sight.see(picture).err();
        true
    }

    fn publish(&mut self, outputs: &mut Outputs<'_>) {
        let Some(stamp) = self.last_picture.filter(|_| self.trouble.is_none()) else { return };
        let header = FreeSpaceHeader { stamp_ns: stamp.0, evidence_ns: stamp.0, sequence: self.published };
        self.directions.clear();
        self.directions.extend(self.sight.distances().ends());
        // Nobody may listen: the drive does not depend on it.
        if outputs.publish(FREE_SPACE.name, &header, &self.directions).is_ok() {
            self.published += 1;
        }
    }

    /// The proposal of a robot that was at `then` when the picture was taken and is at `robot` now.
    fn proposal(&mut self, then: &Pose2, robot: &Pose2, twist: &Twist, now: Time) -> Proposal {
        let stop = |reason| Proposal::drive(self.axes, Twist::ZERO).because(reason);
        if let Some(trouble) = self.trouble {
            let stop = stop(trouble.reason());
            return match trouble {
                Trouble::NoFloorAhead => {
                    stop.with_note(format_args!("no single color right before the robot at the start"))
                }
                Trouble::MaskUnreliable => stop.with_note(format_args!("hardly any floor color around it")),
                Trouble::LowContrast => {
                    stop.with_note(format_args!("even the robot itself is floor-colored"))
                }
                Trouble::MirrorMoved { offset_px } => {
                    stop.with_note(format_args!("the mirror is seen {offset_px:.1} px beside its place"))
                }
            };
        }
        let (direction_rad, distance_m) = match self.destination.wish(&self.odometry, robot) {
            Wish::Arrived => return stop(Reason::Nominal).with_note(format_args!("arrived")),
            Wish::Lost => return stop(Reason::Lost),
            Wish::Towards { direction_rad, distance_m } => (direction_rad, distance_m),
        };
        let moved = then.relative(robot);
        let steer = self.pilot.steer(self.sight.distances(), &moved, twist, (direction_rad, distance_m), now);
        let drive = |twist: Twist| Proposal::drive(self.axes, twist);
        match steer {
            Steer::Drive { twist, share } => {
                drive(twist).with_note(format_args!("{:.0} % of the speed", 100.0 * share))
            }
            Steer::BackOut(twist) => drive(twist).with_note(format_args!("away from what is too near")),
            Steer::Turn(turn_radps) => drive(Twist::planar(0.0, turn_radps))
                .uncoupled()
                .because(Reason::Searching)
                .with_note(format_args!("turns to where the floor is free")),
            Steer::Wait { blocked_s } => {
                stop(Reason::Searching).with_note(format_args!("no free direction for {blocked_s:.1} s"))
            }
            Steer::Blocked { blocked_s } => {
                stop(Reason::PassageBlocked).with_note(format_args!("no free direction for {blocked_s:.0} s"))
            }
            Steer::Brake => Proposal::halt(self.axes, Reason::PassageBlocked)
                .with_note(format_args!("something is nearer than it can stop")),
        }
    }
}

/// The velocity of a twist, m/s.
pub(super) fn velocity(twist: &Twist) -> Vector2<f64> {
    Vector2::new(twist.linear, twist.lateral)
}
