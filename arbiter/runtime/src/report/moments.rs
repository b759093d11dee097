//! Pictures of the moments at which the robot was halted, with what the behaviors saw.

use std::collections::{BTreeMap, VecDeque};

use image::RgbImage;
use yamabico_core::message::{
    DecisionHeader, FrameHeader, Message, MessageType, OverlayHeader, OverlayMark, Proposal, Verdict,
};
use yamabico_core::overlay::{Color, Space, layers};
use yamabico_core::time::Time;

use super::ControlLog;
use super::timeline::because;
use crate::overlay_painter::with_overlays;
use crate::record::Tap;

/// Frames of each camera that are kept until their overlays arrive.
const MAX_FRAMES: usize = 12;
/// Number of halts whose moment is kept.
const MAX_MOMENTS: usize = 12;
/// Maximum age of an overlay at a halt, s.
const MAX_AGE_S: f64 = 1.0;

/// Moment at which the robot was halted.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    /// Time of the decision.
    pub at: Time,
    /// Reason and note of the behavior that halts; empty if no behavior does.
    pub reason: String,
    /// Picture of each camera, by topic.
    pub pictures: Vec<Picture>,
    /// Layers in the robot frame: behavior and marks.
    pub from_above: Vec<(String, Vec<OverlayMark>)>,
}

/// Picture of one camera with its overlays.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// Topic of the frame.
    pub topic: String,
    /// Stamp of the frame.
    pub stamp: Time,
    /// Picture with the overlays drawn.
    pub image: RgbImage,
    /// Behavior, name and color of each layer that was drawn.
    pub layers: Vec<(String, String, Color)>,
}

/// Collects the moments of a recording.
#[derive(Default)]
pub(super) struct Moments {
    frames: BTreeMap<String, VecDeque<(Time, Vec<u8>)>>,
    overlays: BTreeMap<String, (OverlayHeader, Vec<OverlayMark>)>,
    proposals: BTreeMap<String, Proposal>,
    control: ControlLog,
    moments: Vec<Moment>,
}

impl Moments {
    /// Takes in a frame with its compressed image.
    pub fn frame(&mut self, topic: &str, header: &FrameHeader, image: &[u8]) {
        let frames = self.frames.entry(topic.to_owned()).or_default();
        if frames.len() == MAX_FRAMES {
            frames.pop_front();
        }
        frames.push_back((Time(header.stamp_ns), image.to_vec()));
    }

    /// Moments in the order of time.
    pub fn list(&self) -> &[Moment] {
        &self.moments
    }

    fn capture(&mut self, at: Time, by: &str) {
        if self.moments.len() == MAX_MOMENTS {
            return;
        }
        let is_recent = |header: &OverlayHeader| at.seconds_after(Time(header.stamp_ns)) <= MAX_AGE_S;
        let recent = || self.overlays.iter().filter(|(_, (header, _))| is_recent(header));
        let from_above = recent().filter_map(|(behavior, (_, marks))| {
            let has_layers =
                layers(marks).any(|layer| layer.space == Space::Robot && !layer.marks.is_empty());
            has_layers.then(|| (behavior.clone(), marks.clone()))
        });
        let moment = Moment {
            at,
            reason: self.proposals.get(by).map_or_else(String::new, because),
            pictures: self.frames.keys().filter_map(|topic| self.picture(topic, at)).collect(),
            from_above: from_above.collect(),
        };
        self.moments.push(moment);
    }

    /// Draws the newest frame of a camera that a recent overlay shows, or the newest of all, with every overlay of it.
    fn picture(&self, topic: &str, at: Time) -> Option<Picture> {
        let frames = self.frames.get(topic)?;
        let of_topic = || self.overlays.iter().filter(|(_, (header, _))| header.topic.as_str() == topic);
        let is_kept = |stamp: &Time| frames.iter().any(|(kept, _)| kept == stamp);
        let drawn = of_topic().map(|(_, (header, _))| Time(header.stamp_ns)).filter(is_kept);
        let drawn = drawn.filter(|stamp| at.seconds_after(*stamp) <= MAX_AGE_S).max();
        let newest = frames.back()?;
        let (stamp, file) =
            drawn.map_or(newest, |stamp| frames.iter().find(|(kept, _)| *kept == stamp).unwrap_or(newest));
        let picture = image::load_from_memory(file).ok()?.into_rgb8();
        let overlays: Vec<_> =
            of_topic().filter(|(_, (header, _))| Time(header.stamp_ns) == *stamp).collect();
        let marks: Vec<&[OverlayMark]> = overlays.iter().map(|(_, (_, marks))| marks.as_slice()).collect();
        let names = overlays.iter().flat_map(|(behavior, (_, marks))| {
            let shown = layers(marks).filter(|layer| layer.space == Space::Image && !layer.marks.is_empty());
            shown.map(|layer| ((*behavior).clone(), layer.name.as_str().to_owned(), layer.color))
        });
        Some(Picture {
            topic: topic.to_owned(),
            stamp: *stamp,
            image: with_overlays(&picture, &marks, &|_| true),
            layers: names.collect(),
        })
    }
}

impl Tap for Moments {
    fn message(&mut self, topic: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        match message.name {
            OverlayHeader::NAME => {
                let Ok(header) = bytemuck::try_pod_read_unaligned::<OverlayHeader>(header) else { return };
                let marks = items.chunks_exact(size_of::<OverlayMark>()).map(bytemuck::pod_read_unaligned);
                let behavior = topic.strip_prefix("behaviors/").unwrap_or(topic);
                let behavior = behavior.strip_suffix("/overlay").unwrap_or(behavior);
                self.overlays.insert(behavior.to_owned(), (header, marks.collect()));
            }
            Proposal::NAME => {
                let Ok(proposal) = bytemuck::try_pod_read_unaligned::<Proposal>(header) else { return };
                self.proposals.insert(proposal.behavior.as_str().to_owned(), proposal);
            }
            DecisionHeader::NAME => {
                let Ok(decision) = bytemuck::try_pod_read_unaligned::<DecisionHeader>(header) else { return };
                let verdicts = items.chunks_exact(size_of::<Verdict>()).map(bytemuck::pod_read_unaligned);
                let was_halted = self.control.is_halted();
                self.control.decision(&decision, &verdicts.collect::<Vec<_>>());
                if self.control.is_halted() && !was_halted {
                    let by = self.control.owner().unwrap_or_default().to_owned();
                    self.capture(Time(decision.stamp_ns), &by);
                }
            }
            _ => {}
        }
    }
}
