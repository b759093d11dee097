//! Channels: where the records of a run go, and which forms they have.

use foxglove::messages::{
    CameraCalibration, CompressedImage, FrameTransforms, ImageAnnotations, LaserScan, Log, PoseInFrame,
    PosesInFrame, SceneUpdate,
};
use foxglove::{Encode, Schema};
use yamabico_core::message::{
    Channel as Delivery, Command, DecisionHeader, FrameHeader, FreeSpaceHeader, Goal, Imu, Message,
    MessageType, ObstaclesHeader, Odometry, OverlayHeader, PathHeader, Pose, Proposal, RangeScanHeader,
    RobotManifestHeader, Truth, WallsHeader,
};
use yamabico_core::time::Time;

use super::schema;

/// Channel of the coordinate frames.
pub(super) const TRANSFORMS: &str = "/tf";
/// Channel of changes as text.
pub(super) const LOG: &str = "/log";
/// Channel of the robot's outline.
pub(super) const OUTLINE: &str = "/robot/scene";
/// Channel of the map.
pub(super) const MAP_SCENE: &str = "/map/scene";
/// Form of a camera's lens.
pub(super) const CALIBRATION: &str = "calibration";

/// Form of the records of a channel.
#[derive(Clone, Debug)]
pub struct Format {
    /// Encoding of a record: `json` or `protobuf`.
    pub encoding: String,
    /// Schema.
    pub schema: Option<Schema>,
}

/// A channel that an encoder writes.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Topic.
    pub topic: String,
    /// Form of its records.
    pub format: Format,
    /// Set if it has few records, of which the newest holds for a long time, such as the map.
    pub is_lasting: bool,
    /// Set if only its newest record counts.
    pub may_skip: bool,
}

/// Destination of records.
pub trait Records {
    /// Returns true if a record on `topic` of this time is used; otherwise it is not made.
    fn wants(&mut self, topic: &str, time: Time) -> bool;

    /// Takes a record; `format` tells the form of the records of its topic.
    fn take(&mut self, topic: &str, time: Time, format: &dyn Fn() -> Format, data: Vec<u8>);
}

/// Channels that hold the records of messages on these topics.
pub fn channels<'a>(topics: impl IntoIterator<Item = (&'a str, &'a MessageType)>) -> Vec<Channel> {
    let lasting =
        |topic: String, format: Format| Channel { topic, format, is_lasting: true, may_skip: false };
    let mut channels = vec![
        Channel { topic: LOG.to_owned(), format: format_of::<Log>(), is_lasting: false, may_skip: false },
        Channel {
            topic: TRANSFORMS.to_owned(),
            format: format_of::<FrameTransforms>(),
            is_lasting: true,
            may_skip: true,
        },
        lasting(OUTLINE.to_owned(), format_of::<SceneUpdate>()),
        lasting(MAP_SCENE.to_owned(), format_of::<SceneUpdate>()),
    ];
    for (topic, message) in topics {
        let is_lasting = is_lasting(message);
        let states = [
            Odometry::NAME,
            Imu::NAME,
            Truth::NAME,
            RangeScanHeader::NAME,
            DecisionHeader::NAME,
            Command::NAME,
        ];
        let is_state = states.contains(&message.name);
        let may_skip = !is_lasting && (is_state || message.channel == Delivery::Latest);
        let forms = forms(message).into_iter().map(|(form, format)| (under(topic, form), format));
        let own = (topic.to_owned(), json_format(message));
        channels.extend(std::iter::once(own).chain(forms).map(|(topic, format)| {
            let is_lasting = is_lasting || topic.ends_with(CALIBRATION);
            Channel { topic, format, is_lasting, may_skip }
        }));
    }
    channels
}

/// Returns true for a message that is published once and holds until the next one, such as the goal.
#[must_use]
pub fn is_lasting(message: &MessageType) -> bool {
    [Goal::NAME, WallsHeader::NAME, RobotManifestHeader::NAME].contains(&message.name)
}

/// Standard forms of a message type.
fn forms(message: &MessageType) -> Vec<(&'static str, Format)> {
    match message.name {
        FrameHeader::NAME => {
            vec![("image", format_of::<CompressedImage>()), (CALIBRATION, format_of::<CameraCalibration>())]
        }
        RangeScanHeader::NAME => {
            vec![("scan", format_of::<LaserScan>()), ("scene", format_of::<SceneUpdate>())]
        }
        Odometry::NAME | Pose::NAME => vec![("pose", format_of::<PoseInFrame>())],
        Truth::NAME => vec![("pose", format_of::<PoseInFrame>()), ("scene", format_of::<SceneUpdate>())],
        PathHeader::NAME => vec![("path", format_of::<PosesInFrame>())],
        OverlayHeader::NAME => {
            vec![("annotations", format_of::<ImageAnnotations>()), ("scene", format_of::<SceneUpdate>())]
        }
        Goal::NAME
        | ObstaclesHeader::NAME
        | FreeSpaceHeader::NAME
        | WallsHeader::NAME
        | Proposal::NAME
        | Command::NAME => vec![("scene", format_of::<SceneUpdate>())],
        _ => Vec::new(),
    }
}

/// Form of a message in a standard schema.
pub(super) fn format_of<T: Encode>() -> Format {
    Format { encoding: T::get_message_encoding(), schema: T::get_schema() }
}

/// Form of a message as JSON.
pub(super) fn json_format(message: &MessageType) -> Format {
    let schema = schema::of(message).to_string().into_bytes();
    Format { encoding: "json".to_owned(), schema: Some(Schema::new(message.name, "jsonschema", schema)) }
}

/// Channel of a standard form of the messages on `topic`.
pub(super) fn under(topic: &str, form: &str) -> String {
    format!("/{}/{form}", topic.trim_start_matches('/'))
}
