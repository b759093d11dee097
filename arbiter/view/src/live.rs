//! A running robot as a source of the model; it is joined again when it restarts.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use yamabico_core::message::{FrameHeader, Message, MessageType};
use yamabico_core::time::Time;
use yamabico_runtime::client::{ClientError, RobotClient, RobotFeed};
use yamabico_runtime::record::Tap;

use crate::model::{Model, OVERLAY, header};
use crate::recent::Recent;

/// Time between two looks whether the robot runs.
const CHECK_PERIOD: Duration = Duration::from_secs(1);

/// Follows the running robot of one name.
pub struct LiveRobot {
    robot: String,
    connection: Option<(RobotClient, RobotFeed)>,
    checked: Instant,
    model: Model,
    recent: Arc<Mutex<Recent>>,
    joins: u64,
    has_overlays: bool,
}

/// Passes messages to the model and to the buffer of recent messages; a frame is compressed once for both.
struct Both<'a> {
    model: &'a mut Model,
    recent: &'a mut Recent,
}

impl LiveRobot {
    /// Joins the robot.
    ///
    /// # Errors
    /// No such robot is running, or it publishes no manifest.
    pub fn join(robot: &str) -> Result<LiveRobot, ClientError> {
        let mut client = RobotClient::join(robot)?;
        let feed = open_feed(&mut client)?;
        for left_out in feed.unknown() {
            tracing::warn!("not shown: {left_out}");
        }
        Ok(LiveRobot {
            robot: robot.to_owned(),
            connection: Some((client, feed)),
            checked: Instant::now(),
            model: Model::default(),
            recent: Arc::default(),
            joins: 1,
            has_overlays: false,
        })
    }

    /// Name of the robot.
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// State of the robot; after its end, the last one.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Messages of the last minute.
    pub fn recent(&self) -> Arc<Mutex<Recent>> {
        Arc::clone(&self.recent)
    }

    /// Returns true if the robot is running.
    pub fn is_running(&self) -> bool {
        self.connection.is_some()
    }

    /// Number of times that the robot was joined: the model begins anew each time.
    pub fn joins(&self) -> u64 {
        self.joins
    }

    /// Asks the behaviors to draw overlays, or no longer; while nobody asks, drawing costs them nothing.
    pub fn ask_for_overlays(&mut self, is_wanted: bool) {
        let Some((_, feed)) = &mut self.connection else { return };
        if std::mem::replace(&mut self.has_overlays, is_wanted) == is_wanted {
            return;
        }
        let of_type = |message: &MessageType| message.name == OVERLAY;
        if let Err(error) = feed.subscribe_to(&of_type, is_wanted) {
            tracing::warn!("overlays are not shown: {error}");
        }
    }

    /// Takes in everything that the robot has published since the last call.
    pub fn step(&mut self) {
        if let Some((_, feed)) = &mut self.connection {
            let mut recent = self.recent.lock().unwrap_or_else(PoisonError::into_inner);
            let received = feed.receive(&mut Both { model: &mut self.model, recent: &mut recent });
            match received {
                Ok(now) => self.model.set_time(now),
                Err(error) => {
                    tracing::warn!("reading from the robot failed: {error}");
                    self.connection = None;
                }
            }
        }
        if self.checked.elapsed() >= CHECK_PERIOD {
            self.checked = Instant::now();
            self.check();
        }
    }

    fn check(&mut self) {
        if let Some((client, _)) = &self.connection {
            if !client.is_running() {
                self.connection = None;
            }
            return;
        }
        let joined = RobotClient::join(&self.robot).and_then(|mut client| {
            let feed = open_feed(&mut client)?;
            Ok((client, feed))
        });
        if let Ok(connection) = joined {
            self.connection = Some(connection);
            self.model = Model::default();
            *self.recent.lock().unwrap_or_else(PoisonError::into_inner) = Recent::default();
            self.joins += 1;
            self.has_overlays = false;
        }
    }
}

/// Feed of every topic but the overlays.
fn open_feed(client: &mut RobotClient) -> Result<RobotFeed, ClientError> {
    client.feed(&|message| message.name != OVERLAY)
}

impl Tap for Both<'_> {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, bytes: &[u8], list: &[u8]) {
        self.model.message(topic, message, time, bytes, list);
        if message.name != FrameHeader::NAME {
            return self.recent.add(topic, message, time, bytes, list.into());
        }
        let stamp_ns = header::<FrameHeader>(bytes).map(|header| header.stamp_ns);
        let picture = self.model.pictures().get(topic, stamp_ns);
        if let Some(picture) = picture.filter(|picture| Some(picture.header.stamp_ns) == stamp_ns) {
            self.recent.add(topic, message, time, bytes, Arc::clone(&picture.data));
        }
    }
}
