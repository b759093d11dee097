//! Feed of the clients: the messages of a running robot as records.

use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use yamabico_core::message::MessageType;
use yamabico_core::time::Time;
use yamabico_runtime::record::{Encoder, ImageFormat, RobotSetup, Tap};

use super::Foxglove;
use super::parameters;
use super::session::{Publisher, Session};
use crate::live::LiveRobot;
use crate::model::read_maps;

/// Minimum time between two messages of the time, s.
const TIME_PERIOD_S: f64 = 0.015;

/// Makes records of a robot's messages for the clients; their times are those of the wall clock.
pub(in crate::server) struct Feed {
    foxglove: Arc<Foxglove>,
    encoder: Encoder,
    publisher: Publisher,
    joins: u64,
    setup_version: Option<u64>,
    time_sent: Time,
}

impl Feed {
    /// Feed of a robot that was just joined.
    pub fn new(foxglove: Arc<Foxglove>, robot: &mut LiveRobot) -> Feed {
        let manifest = robot.manifest();
        let session = Arc::new(Session::new(manifest, robot.joins()));
        let setup = RobotSetup {
            radius_m: manifest.radius_m,
            sensors: manifest.sensors.clone(),
            map: read_maps(manifest),
        };
        let mut encoder = Encoder::new(setup, ImageFormat::IsJpeg);
        let mut publisher = Publisher::new(Arc::clone(&session));
        let wall_clock = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let start = Time(u64::try_from(wall_clock.as_nanos()).unwrap_or(u64::MAX));
        encoder.begin(&mut publisher, robot.now(), start);
        foxglove.sessions.send_replace(session);
        let joins = robot.joins();
        Feed { foxglove, encoder, publisher, joins, setup_version: None, time_sent: Time::ZERO }
    }

    /// Follows a step of the robot: its time, its parameters, and its restarts.
    pub fn update(&mut self, robot: &mut LiveRobot) {
        if robot.joins() != self.joins {
            *self = Feed::new(Arc::clone(&self.foxglove), robot);
        }
        let model = robot.model();
        let now = self.encoder.time(model.now());
        if now.seconds_after(self.time_sent) >= TIME_PERIOD_S {
            self.time_sent = now;
            self.publisher.session().send_time(now);
        }
        let version = model.setup_version();
        if self.setup_version.replace(version) != Some(version) {
            let parameters = parameters::of(&model.setup().0.parameters);
            self.foxglove.parameters.send_replace(parameters.into());
        }
    }

    /// Returns true if a client wants what the behaviors draw.
    pub fn wants_overlays(&self) -> bool {
        self.publisher.session().wants_overlays()
    }
}

impl Tap for Feed {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, bytes: &[u8], list: &[u8]) {
        self.encoder.message(&mut self.publisher, topic, message, time, (bytes, list));
    }
}
