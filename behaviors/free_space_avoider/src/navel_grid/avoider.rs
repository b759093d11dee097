//! The behavior with the navel grid: looks, decides and proposes.

use yamabico_core::behavior::{BuildError, Inputs, Outputs, Setup};
use yamabico_core::camera::Intrinsics;
use yamabico_core::geometry::{Twist, angle_difference};
use yamabico_core::image::GrayImage;
use yamabico_core::message::{Axes, FrameHeader, FreeSpaceHeader, Proposal, Reason, View};
use yamabico_core::odometry_track::{FUTURE_TOLERANCE_S, OdometryTrack};
use yamabico_core::sensor::MountedPinhole;
use yamabico_core::time::Time;

use super::ground::Swath;
use super::{Motion, OpenFloor, Outlook, Passage, Sight, Steering, Trouble};
use crate::config::{Config, HeadingRule};
use crate::direction::Drive;
use crate::stopping::stopping_distance_m;
use crate::{CAMERA, FREE_SPACE, ODOMETRY, STALE_S};

/// Drives where the cells of one forward camera are free.
#[derive(Clone, Debug)]
pub struct NavelGridAvoider {
    speed_mps: f64,
    turn_radps: f64,
    intrinsics: Intrinsics,
    way: Swath,
    sight: Sight,
    steering: Steering,
    open_floor: Option<OpenFloor>,
    heading: Option<Drive>,
    odometry: OdometryTrack,
    gray: GrayImage,
    /// Turned since the last picture, radians.
    turned_rad: f64,
    last_picture: Option<Time>,
    trouble: Option<Trouble>,
    malformed: bool,
    published: u64,
}

impl NavelGridAvoider {
    /// The behavior for a robot with a forward camera.
    ///
    /// # Errors
    /// Another kind of camera, or one that cannot show the way ahead.
    pub fn new(config: &Config, setup: &Setup) -> Result<Self, BuildError> {
        let MountedPinhole { pinhole, mount, period_s, latency_s, .. } = setup.pinhole(&CAMERA)?;
        let way = Swath {
            length_m: stopping_distance_m(
                config.speed_mps,
                config.margin_m,
                &setup.robot,
                period_s + latency_s,
            ),
            half_width_m: setup.robot.radius_m + config.side_m,
        };
        let sight = Sight::new(config, &pinhole, &mount, &way)?;
        let open_floor = match config.heading {
            HeadingRule::Weights => None,
            HeadingRule::Clearance if setup.sensor(&ODOMETRY).is_none() => {
                return Err(BuildError::new("inputs.odometry", "headings by clearance need odometry"));
            }
            HeadingRule::Clearance => {
                let open_floor = OpenFloor::new(config, sight.ground(), &setup.robot);
                Some(open_floor.ok_or_else(|| {
                    BuildError::new(
                        "heading",
                        "the robot cannot brake and turn, or the camera shows no floor far ahead",
                    )
                })?)
            }
        };
        Ok(Self {
            speed_mps: config.speed_mps,
            turn_radps: config.turn_radps,
            intrinsics: *pinhole.intrinsics(),
            way,
            sight,
            steering: Steering::new(config.patience_s),
            open_floor,
            heading: None,
            odometry: OdometryTrack::default(),
            gray: GrayImage::default(),
            turned_rad: 0.0,
            last_picture: None,
            trouble: None,
            malformed: false,
            published: 0,
        })
    }

    /// Looks at the inputs once and proposes.
    pub fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
        let now = inputs.now();
        self.measure_turn(inputs, now);
        if let Some(frame) = inputs.latest(&CAMERA).filter(|_| inputs.is_fresh(&CAMERA)) {
            self.look(&frame, now);
            self.publish(outputs);
        }
        match self.last_picture {
            Some(stamp) if self.malformed => Proposal::abstain(Reason::MalformedInput).with_evidence(stamp),
            None if self.malformed => Proposal::abstain(Reason::MalformedInput),
            None => Proposal::abstain(Reason::NoInput),
            Some(stamp) if now.seconds_after(stamp) > STALE_S => {
                Proposal::abstain(Reason::StaleInput).with_evidence(stamp)
            }
            Some(stamp) => self.proposal().with_evidence(stamp),
        }
    }

    /// What it sees.
    #[must_use]
    pub fn sight(&self) -> &Sight {
        &self.sight
    }

    /// The way ahead that must be free: as far as the robot needs to stop, as wide as it is.
    #[must_use]
    pub fn way(&self) -> Swath {
        self.way
    }

    /// Adds up the turn between pictures, where odometry tells it.
    fn measure_turn(&mut self, inputs: &Inputs<'_>, now: Time) {
        for odometry in inputs.fresh(&ODOMETRY) {
            let before = self.odometry.newest().map(|reading| reading.pose.theta);
            if self.odometry.push(odometry.header, now)
                && let (Some(before), Some(newest)) = (before, self.odometry.newest())
            {
                self.turned_rad += angle_difference(newest.pose.theta, before).abs();
            }
        }
    }

    fn look(&mut self, frame: &View<'_, FrameHeader>, now: Time) {
        let stamp = Time(frame.header.stamp_ns);
        let is_newer = self.last_picture.is_none_or(|last| stamp > last);
        let image = frame.gray(self.intrinsics.size(), &mut self.gray);
        let usable = image.filter(|_| is_newer && stamp.seconds_after(now) <= FUTURE_TOLERANCE_S);
        self.malformed = usable.is_none();
        let Some(image) = usable else { return };
        let (mut outlook, trouble) = self.sight.see(image);
        self.trouble = trouble;
        if let Some(open_floor) = &mut self.open_floor {
            let twist = self.odometry.newest().map_or(Twist::ZERO, |reading| reading.twist);
            self.heading = open_floor.choose(self.sight.directions(), &twist);
            if let (Outlook::Seen(weights, _), None) = (outlook, self.heading) {
                outlook = Outlook::Seen(weights, Passage::Obstructed);
            }
        }
        let turned_rad = match (self.odometry.newest(), self.last_picture) {
            (Some(_), _) => std::mem::take(&mut self.turned_rad),
            (None, Some(last)) => self.turn_radps * stamp.seconds_after(last),
            (None, None) => 0.0,
        };
        self.last_picture = Some(stamp);
        self.steering.step(outlook, turned_rad, stamp);
    }

    fn publish(&mut self, outputs: &mut Outputs<'_>) {
        let Some(stamp) = self.last_picture.filter(|_| !self.malformed && self.trouble.is_none()) else {
            return;
        };
        let sequence = self.published;
        let header = FreeSpaceHeader { stamp_ns: stamp.0, evidence_ns: stamp.0, sequence };
        // Nobody may listen: the drive does not depend on it.
        if outputs.publish(FREE_SPACE.name, &header, self.sight.directions()).is_ok() {
            self.published += 1;
        }
    }

    fn proposal(&self) -> Proposal {
        let drive =
            |speed_mps, turn_radps| Proposal::drive(Axes::PLANAR, Twist::planar(speed_mps, turn_radps));
        let why = self.trouble.map(Trouble::reason);
        match self.steering.motion() {
            Motion::Forward { share, turn_radps } => {
                let speed_mps = share * self.speed_mps;
                let chosen = self.heading.map(|heading| heading.twist);
                let twist = chosen.unwrap_or(Twist::planar(speed_mps, turn_radps));
                drive(twist.linear.min(speed_mps), twist.angular)
                    .with_note(format_args!("free ahead, {:.0} % of the speed", 100.0 * share))
            }
            // A turn goes on where a halt names only translation.
            Motion::Turn(side) => drive(0.0, side.sign() * self.turn_radps)
                .uncoupled()
                .because(why.unwrap_or(Reason::Searching)),
            Motion::Stop => {
                drive(0.0, 0.0).because(why.unwrap_or(Reason::PassageBlocked)).with_note(match self.trouble {
                    None => format_args!("both sides are blocked"),
                    Some(Trouble::LowContrast) => format_args!("floor and obstacles look alike"),
                    Some(Trouble::FloorModelBroken) => format_args!("hardly any floor in view"),
                    Some(Trouble::NoFloorAhead) => {
                        format_args!("no floor right ahead at the start: is `polarity` right?")
                    }
                })
            }
            Motion::ShutIn => drive(0.0, 0.0)
                .because(Reason::PassageBlocked)
                .with_note(format_args!("a full turn has shown no way forward")),
        }
    }
}
