//! The behavior with method `navel-grid`.

use yamabico_core::behavior::{Inputs, Outputs, ParameterError, Setup};
use yamabico_core::camera::Intrinsics;
use yamabico_core::geometry::{Twist, angle_difference};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{Axes, FrameHeader, FreeSpaceHeader, Proposal, Reason, View};
use yamabico_core::odometry_track::OdometryTrack;
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;
use yamabico_vision::floor_appearance::{AppearanceFile, LearnedLook, Picture};

use super::ground::Swath;
use super::overlay;
use super::{GridFailure, Motion, Observation, OpenFloor, Passage, PathObserver, Steering};
use crate::config::{Config, HeadingRule};
use crate::direction::HeadingChoice;
use crate::echoes::Echoes;
use crate::stopping::stopping_distance_m;
use crate::{CAMERA, FREE_SPACE, IMU, ODOMETRY, STALE_S};

/// Avoider that drives where the cells of a forward camera's image are free.
#[derive(Clone, Debug)]
pub struct NavelGridAvoider {
    speed_mps: f64,
    turn_radps: f64,
    intrinsics: Intrinsics,
    path: Swath,
    radius_m: f64,
    observer: PathObserver,
    steering: Steering,
    open_floor: Option<OpenFloor>,
    heading: Option<HeadingChoice>,
    odometry: OdometryTrack,
    echoes: Echoes,
    gray: GrayImage,
    /// Absolute turn since the last frame, rad.
    turned_rad: f64,
    last_frame: Option<Time>,
    failure: Option<GridFailure>,
    is_malformed: bool,
    sequence: u64,
}

impl NavelGridAvoider {
    /// Creates the behavior for a robot with a forward camera.
    ///
    /// # Errors
    /// The camera is of another kind or cannot show the path ahead, or the robot cannot choose headings by clearance.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, ParameterError> {
        let MountedPinhole { pinhole, mount, period_s, latency_s, .. } = setup.pinhole(&CAMERA)?;
        let path = Swath {
            length_m: stopping_distance_m(
                config.speed_mps,
                config.margin_m,
                &setup.robot,
                period_s + latency_s,
            ),
            half_width_m: setup.robot.radius_m + config.side_m,
        };
        let look = match &config.floor_appearance {
            Some(file) => AppearanceFile::read(&setup.folder.join(file))
                .map_err(|problem| ParameterError::new("floor_appearance", problem))?,
            None => LearnedLook::default(),
        };
        let observer = PathObserver::new(config, &pinhole, &mount, &path, look)?;
        let open_floor = match config.heading {
            HeadingRule::Weights => None,
            HeadingRule::Clearance if setup.sensor(&ODOMETRY).is_none() => {
                return Err(ParameterError::new(
                    "inputs.odometry",
                    "is missing, and `heading = \"clearance\"` needs odometry",
                )
                .remedy("connect an odometry sensor: inputs.odometry = \"...\""));
            }
            HeadingRule::Clearance => {
                let open_floor = OpenFloor::new(config, observer.ground(), &setup.robot);
                Some(open_floor.ok_or_else(|| {
                    ParameterError::new(
                        "heading",
                        "must be \"weights\" here: the robot's accelerations are not positive, or a column of \
                         the grid shows no floor",
                    )
                })?)
            }
        };
        Ok(Self {
            speed_mps: config.speed_mps,
            turn_radps: config.turn_radps,
            intrinsics: *pinhole.intrinsics(),
            path,
            radius_m: setup.robot.radius_m,
            observer,
            steering: Steering::new(config.blocked_timeout_s),
            open_floor,
            heading: None,
            odometry: OdometryTrack::default(),
            echoes: Echoes::new(setup),
            gray: GrayImage::default(),
            turned_rad: 0.0,
            last_frame: None,
            failure: None,
            is_malformed: false,
            sequence: 0,
        })
    }

    /// Processes the inputs and returns a proposal.
    pub fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        self.measure_turn(inputs, now);
        self.echoes.update(inputs);
        if let Some(frame) = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            self.process_frame(&frame, now);
            self.publish(outputs);
            if !self.is_malformed {
                outputs.draw(&CAMERA, frame.header, |overlay| {
                    overlay::draw(overlay, &self.observer, &self.intrinsics, self.heading.as_ref());
                });
            }
        }
        match self.last_frame {
            Some(stamp) if self.is_malformed => {
                Proposal::abstain(Reason::MalformedInput).with_evidence(stamp)
            }
            None if self.is_malformed => Proposal::abstain(Reason::MalformedInput),
            None => Proposal::abstain(Reason::NoInput),
            Some(stamp) if now.seconds_after(stamp) > STALE_S || self.echoes.is_silent(now) => {
                Proposal::abstain(Reason::StaleInput).with_evidence(stamp)
            }
            Some(stamp) => self.proposal().with_evidence(stamp),
        }
    }

    /// Returns the observer of the path ahead, with the results of the last frame.
    #[must_use]
    pub fn observer(&self) -> &PathObserver {
        &self.observer
    }

    /// Returns the path ahead that must be free: stopping distance by width of the robot.
    #[must_use]
    pub fn path(&self) -> Swath {
        self.path
    }

    /// Accumulates the turn between frames, if there is odometry.
    fn measure_turn(&mut self, inputs: &Inputs<'_>, now: Time) {
        for imu in inputs.fresh(&IMU) {
            self.odometry.push_imu(imu.header, now);
        }
        for odometry in inputs.fresh(&ODOMETRY) {
            let before = self.odometry.newest().map(|reading| reading.pose.theta);
            if self.odometry.push(odometry.header, now)
                && let (Some(before), Some(newest)) = (before, self.odometry.newest())
            {
                self.turned_rad += angle_difference(newest.pose.theta, before).abs();
            }
        }
    }

    fn process_frame(&mut self, frame: &View<'_, FrameHeader>, now: Time) {
        let stamp = Time(frame.header.stamp_ns);
        let size = self.intrinsics.size();
        let color = frame.rgb(size).filter(|_| self.observer.uses_color()).map(Picture::Color);
        let picture = color.or_else(|| frame.gray(size, &mut self.gray).map(Picture::Gray));
        let usable = picture.filter(|_| stamp.is_next(self.last_frame, now));
        self.is_malformed = usable.is_none();
        let Some(picture) = usable else { return };
        self.echoes.place(&self.odometry, stamp);
        let (mut observation, failure) = self.observer.observe(picture, &self.echoes);
        self.failure = failure;
        if let (None, Some(seen_from), Some(newest)) =
            (failure, self.odometry.pose_at(stamp), self.odometry.newest())
        {
            let elapsed_s = self.last_frame.map_or(0.0, |last| stamp.seconds_after(last));
            self.observer.learn(&seen_from, &newest.pose, self.radius_m, elapsed_s);
        }
        if let Some(open_floor) = &mut self.open_floor {
            let twist = self.odometry.newest().map_or(Twist::ZERO, |reading| reading.twist);
            self.heading = open_floor.choose(self.observer.directions(), &twist);
            if let (Observation::Seen(weights, _), None) = (observation, self.heading) {
                observation = Observation::Seen(weights, Passage::Obstructed);
            }
        }
        let turned_rad = match (self.odometry.newest(), self.last_frame) {
            (Some(_), _) => std::mem::take(&mut self.turned_rad),
            (None, Some(last)) => self.turn_radps * stamp.seconds_after(last),
            (None, None) => 0.0,
        };
        self.last_frame = Some(stamp);
        self.steering.step(observation, turned_rad, stamp);
    }

    fn publish(&mut self, outputs: &mut Outputs<'_>) {
        let Some(stamp) = self.last_frame.filter(|_| !self.is_malformed && self.failure.is_none()) else {
            return;
        };
        let header = FreeSpaceHeader { stamp_ns: stamp.0, evidence_ns: stamp.0, sequence: self.sequence };
        // The output may have no subscriber; the drive does not depend on it.
        if outputs.publish(FREE_SPACE.name, &header, self.observer.directions()).is_ok() {
            self.sequence += 1;
        }
    }

    fn proposal(&self) -> Proposal {
        let drive =
            |speed_mps, turn_radps| Proposal::drive(Axes::PLANAR, Twist::planar(speed_mps, turn_radps));
        let reason = self.failure.map(GridFailure::reason);
        match self.steering.motion() {
            Motion::Forward { share, turn_radps } => {
                let speed_mps = share * self.speed_mps;
                let chosen = self.heading.map(|heading| heading.twist);
                let twist = chosen.unwrap_or(Twist::planar(speed_mps, turn_radps));
                drive(twist.linear.min(speed_mps), twist.angular)
                    .with_note(format_args!("free ahead, {:.0} % of the speed", 100.0 * share))
            }
            // A halt of the translation alone does not stop the turn.
            Motion::Turn(side) => drive(0.0, side.sign() * self.turn_radps)
                .uncoupled()
                .with_reason(reason.unwrap_or(Reason::Searching)),
            Motion::Stop => drive(0.0, 0.0).with_reason(reason.unwrap_or(Reason::PassageBlocked)).with_note(
                match self.failure {
                    None => format_args!("both sides are blocked"),
                    Some(GridFailure::LowContrast) => format_args!("floor and obstacles look alike"),
                    Some(GridFailure::FloorModelBroken) => format_args!("too little floor in view"),
                    Some(GridFailure::NoFloorAhead) => {
                        format_args!("no floor ahead at the start: check `polarity`")
                    }
                },
            ),
            Motion::Enclosed => drive(0.0, 0.0)
                .with_reason(Reason::PassageBlocked)
                .with_note(format_args!("no free path in a full turn")),
        }
    }
}
