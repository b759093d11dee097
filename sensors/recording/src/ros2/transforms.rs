//! Frames of the robot, from `tf2_msgs/msg/TFMessage` on `/tf_static`.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Quaternion as Numbers, Translation3, UnitQuaternion};
use serde::Deserialize;

use super::{Header, Quaternion, Vector, finite, read};
use crate::measurement::Refusal;
use crate::storage::Messages;
use crate::yamabico::{self, FRAME_TRANSFORMS};

/// Name of the message type.
pub const TF_MESSAGE: &str = "tf2_msgs/msg/TFMessage";
/// Names of the robot's own frame, the best first.
const BODY: [&str; 3] = ["base_footprint", "base_link", "base"];
/// Maximum number of frames between a sensor and the robot.
const MAX_LINKS: usize = 64;
/// Maximum number of frames.
const MAX_FRAMES: usize = 10_000;

#[derive(Deserialize)]
struct TransformStamped {
    header: Header,
    child_frame_id: String,
    translation: Vector,
    rotation: Quaternion,
}

#[derive(Deserialize)]
struct TfMessage {
    transforms: Vec<TransformStamped>,
}

/// Fixed frames of a robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frames {
    /// Parent of each frame, and the transform from the frame to it.
    parents: BTreeMap<String, (String, Isometry3<f64>)>,
}

impl Frames {
    /// Reads the fixed frames of the recording `path`, from the topic `/tf_static`; of a recording of this program, the frames at its
    /// beginning.
    ///
    /// # Errors
    /// The description of what cannot be read.
    pub fn of(path: &Path) -> Result<Frames, String> {
        let mut frames = Frames::default();
        // Malformed messages are left out, and the beginning of a file that breaks off counts.
        for message in Messages::open(path)?.map_while(Result::ok) {
            let topic = &message.topic;
            if topic.message_type == TF_MESSAGE && topic.name.ends_with("/tf_static") {
                let _ = frames.add(&message.data);
            } else if topic.message_type == FRAME_TRANSFORMS && frames.parents.is_empty() {
                let _ = yamabico::add_frames(&mut frames, &message.data);
            }
        }
        Ok(frames)
    }

    /// Adds the transforms of a CDR message.
    ///
    /// # Errors
    /// A malformed message.
    pub fn add(&mut self, data: &[u8]) -> Result<(), Refusal> {
        let message: TfMessage = read(data)?;
        for TransformStamped { header, child_frame_id, translation: t, rotation: q } in message.transforms {
            self.insert(&child_frame_id, &header.frame_id, [t.x, t.y, t.z], [q.x, q.y, q.z, q.w])?;
        }
        Ok(())
    }

    /// Adds the transform of a frame to its parent: a translation, m, and a rotation as a quaternion x, y, z, w.
    ///
    /// # Errors
    /// Numbers that are no transform.
    pub(crate) fn insert(
        &mut self,
        child: &str,
        parent: &str,
        [x, y, z]: [f64; 3],
        [i, j, k, w]: [f64; 4],
    ) -> Result<(), Refusal> {
        finite(&[x, y, z, i, j, k, w], "a transform")?;
        let rotation = UnitQuaternion::try_new(Numbers::new(w, i, j, k), 1e-6);
        let rotation = rotation.ok_or_else(|| Refusal::Malformed("a rotation of length 0".to_owned()))?;
        let parent_from_child = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
        if self.parents.len() < MAX_FRAMES {
            let plain = |name: &str| name.trim_start_matches('/').to_owned();
            self.parents.insert(plain(child), (plain(parent), parent_from_child));
        }
        Ok(())
    }

    /// Returns the transform from `frame` to the frame of the robot on the floor, or to its body where there is none on the
    /// floor; `None` if they are not connected.
    #[must_use]
    pub fn body_from(&self, frame: &str) -> Option<Isometry3<f64>> {
        let mut at = frame.trim_start_matches('/').to_owned();
        let mut from_frame = Isometry3::identity();
        let mut found: Option<(usize, Isometry3<f64>)> = None;
        for _ in 0..MAX_LINKS {
            let rank = BODY.iter().position(|name| *name == at);
            if let Some(rank) = rank.filter(|rank| found.is_none_or(|(best, _)| *rank < best)) {
                found = Some((rank, from_frame));
            }
            let Some((parent, parent_from_child)) = self.parents.get(&at) else { break };
            from_frame = parent_from_child * from_frame;
            at.clone_from(parent);
        }
        found.map(|(_, body_from_frame)| body_from_frame)
    }

    /// Names of the frames with their parents, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = (&str, &str)> {
        self.parents.iter().map(|(child, (parent, _))| (child.as_str(), parent.as_str()))
    }
}
