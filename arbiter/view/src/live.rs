//! A running robot as a source of the model; it is joined again when it restarts.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use yamabico_core::message::{CallHeader, FrameHeader, HeardHeader, Message, MessageType};
use yamabico_core::time::Time;
use yamabico_runtime::client::{ClientError, RobotClient, RobotFeed};
use yamabico_runtime::execution::RobotManifest;
use yamabico_runtime::record::Tap;

use crate::model::{Model, OVERLAY, header};
use crate::recent::Recent;

/// Time between two looks whether the robot runs.
const CHECK_PERIOD: Duration = Duration::from_secs(1);

/// Follows the running robot of one name.
pub struct LiveRobot {
    robot: String,
    connection: Option<(RobotClient, RobotFeed)>,
    manifest: RobotManifest,
    checked: Instant,
    model: Model,
    recent: Arc<Mutex<Recent>>,
    joins: u64,
    has_overlays: bool,
}

/// Passes messages to the model, to the buffer of recent messages and to viewers; a frame is compressed once for all.
struct Receivers<'a, 'v> {
    model: &'a mut Model,
    recent: &'a mut Recent,
    viewers: Option<&'v mut dyn Tap>,
}

impl LiveRobot {
    /// Joins the robot.
    ///
    /// # Errors
    /// No such robot is running, or it publishes no manifest.
    pub fn join(robot: &str) -> Result<LiveRobot, ClientError> {
        let mut client = RobotClient::join(robot)?;
        let manifest = client.manifest()?.clone();
        let recent = Arc::new(Mutex::new(Recent::new(&manifest)));
        let feed = open_feed(&mut client)?;
        for left_out in feed.unknown() {
            tracing::warn!("not shown: {left_out}");
        }
        Ok(LiveRobot {
            robot: robot.to_owned(),
            connection: Some((client, feed)),
            manifest,
            checked: Instant::now(),
            model: Model::default(),
            recent,
            joins: 1,
            has_overlays: false,
        })
    }

    /// Name of the robot.
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// Plugins and topics of the robot.
    pub fn manifest(&self) -> &RobotManifest {
        &self.manifest
    }

    /// Time on the robot's clock; zero while it does not run.
    pub fn now(&mut self) -> Time {
        let connection = self.connection.as_mut();
        connection.and_then(|(_, feed)| feed.now().ok()).unwrap_or(Time::ZERO)
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

    /// Asks the behaviors to draw overlays, or no longer; while no client asks, drawing costs them nothing.
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

    /// Takes in everything that the robot has published since the last call, and passes it to `viewers`: instead of its
    /// pixels, a frame has its picture as a JPEG.
    pub fn step(&mut self, viewers: Option<&mut dyn Tap>) {
        if let Some((_, feed)) = &mut self.connection {
            let mut recent = self.recent.lock().unwrap_or_else(PoisonError::into_inner);
            let received =
                feed.receive(&mut Receivers { model: &mut self.model, recent: &mut recent, viewers });
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
            let manifest = client.manifest()?.clone();
            let feed = open_feed(&mut client)?;
            Ok((manifest, (client, feed)))
        });
        if let Ok((manifest, connection)) = joined {
            self.connection = Some(connection);
            self.manifest = manifest;
            self.model = Model::default();
            *self.recent.lock().unwrap_or_else(PoisonError::into_inner) = Recent::new(&self.manifest);
            self.joins += 1;
            self.has_overlays = false;
        }
    }
}

/// Returns true for messages that are shown: all but the logs of calls, whose topics have room for the recorder alone.
pub(crate) fn is_shown(message: &MessageType) -> bool {
    ![CallHeader::NAME, HeardHeader::NAME].contains(&message.name)
}

/// Feed of every topic that is shown but the overlays.
fn open_feed(client: &mut RobotClient) -> Result<RobotFeed, ClientError> {
    client.feed(&|message| is_shown(message) && message.name != OVERLAY)
}

impl Tap for Receivers<'_, '_> {
    fn message(&mut self, topic: &str, message: &MessageType, time: Time, bytes: &[u8], list: &[u8]) {
        self.model.message(topic, message, time, bytes, list);
        let is_frame = message.name == FrameHeader::NAME;
        let items = if is_frame { self.picture(topic, bytes) } else { Some(list.into()) };
        let Some(items) = items else { return };
        if let Some(viewers) = &mut self.viewers {
            viewers.message(topic, message, time, bytes, &items);
        }
        self.recent.add(topic, message, time, bytes, items);
    }
}

impl Receivers<'_, '_> {
    /// Picture of a frame; `None` if there is none, since the last one is too new.
    fn picture(&self, topic: &str, bytes: &[u8]) -> Option<Arc<[u8]>> {
        let stamp_ns = header::<FrameHeader>(bytes)?.stamp_ns;
        let picture = self.model.pictures().get(topic, Some(stamp_ns))?;
        (picture.header.stamp_ns == stamp_ns).then(|| Arc::clone(&picture.data))
    }
}
