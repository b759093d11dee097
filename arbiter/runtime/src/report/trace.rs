//! Trace of a run: its path, and the behavior in control along it.

use yamabico_core::geometry::Pose2;
use yamabico_core::message::{DecisionHeader, Message, MessageType, Odometry, Truth, Verdict};
use yamabico_core::time::Time;

use super::{ControlLog, Encounter, Encounters, Halt};
use crate::record::Tap;

/// Minimum distance between the points of a track, m.
const SPACING_M: f64 = 0.01;
/// Number of points above which a track is thinned to half.
const MAX_POINTS: usize = 50_000;

/// A point of a track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracePoint {
    /// Pose of the robot.
    pub pose: Pose2,
    /// Behavior in control: index into [`Trace::owners`]; `None` if none was.
    pub owner: Option<usize>,
}

/// Path of the robot as points a few centimeters apart.
#[derive(Clone, Debug)]
pub struct Track {
    points: Vec<TracePoint>,
    spacing_m: f64,
}

impl Default for Track {
    fn default() -> Self {
        Track { points: Vec::new(), spacing_m: SPACING_M }
    }
}

impl Track {
    /// Points in the order of the run.
    pub fn points(&self) -> &[TracePoint] {
        &self.points
    }

    fn push(&mut self, pose: Pose2, owner: Option<usize>) {
        if !pose.is_finite() {
            return;
        }
        let is_new = self
            .points
            .last()
            .is_none_or(|last| last.owner != owner || last.pose.distance(&pose) >= self.spacing_m);
        if is_new {
            self.points.push(TracePoint { pose, owner });
        }
        if self.points.len() > MAX_POINTS {
            self.spacing_m *= 2.0;
            let mut keep = false;
            self.points.retain(|_| {
                keep = !keep;
                keep
            });
        }
    }
}

/// A halt and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct HaltMark {
    /// Halt.
    pub halt: Halt,
    /// Pose of the robot at the begin of the halt: map frame with a truth, else odometry frame.
    pub pose: Pose2,
}

/// Collects the tracks, halts and encounters of a run from its messages.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    truth: Track,
    odometry: Track,
    start: Option<(Pose2, Pose2)>,
    control: ControlLog,
    encounters: Encounters,
    owners: Vec<String>,
    halts: Vec<Pose2>,
    verdicts: Vec<Verdict>,
}

impl Trace {
    /// True track, map frame; empty without a simulator.
    pub fn truth(&self) -> &[TracePoint] {
        self.truth.points()
    }

    /// Track by odometry, moved onto the truth at the start; in the odometry frame without a truth.
    pub fn odometry(&self) -> Vec<TracePoint> {
        let map_from_odom = self.start.map_or(Pose2::IDENTITY, |(truth, odom)| truth * odom.inverse());
        let moved = |point: &TracePoint| TracePoint { pose: map_from_odom * point.pose, ..*point };
        self.odometry.points().iter().map(moved).collect()
    }

    /// Behaviors that were in control, in the order of appearance.
    pub fn owners(&self) -> &[String] {
        &self.owners
    }

    /// Halts and their places.
    pub fn halts(&self) -> Vec<HaltMark> {
        let halts = self.control.halts().into_iter();
        halts.zip(&self.halts).map(|(halt, &pose)| HaltMark { halt, pose }).collect()
    }

    /// Encounters with people.
    pub fn encounters(&self) -> Vec<Encounter> {
        self.encounters.list()
    }

    fn here(&self) -> Pose2 {
        let last = self.truth.points.last().or(self.odometry.points.last());
        last.map_or(Pose2::IDENTITY, |point| point.pose)
    }

    fn owner(&mut self) -> Option<usize> {
        let owner = self.control.owner()?;
        Some(self.owners.iter().position(|known| known == owner).unwrap_or_else(|| {
            self.owners.push(owner.to_owned());
            self.owners.len() - 1
        }))
    }
}

impl Tap for Trace {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        match message.name {
            Truth::NAME => {
                let Ok(truth) = bytemuck::try_pod_read_unaligned::<Truth>(header) else { return };
                let (pose, owner) = (Pose2 { x: truth.x, y: truth.y, theta: truth.theta }, self.owner());
                self.truth.push(pose, owner);
                self.encounters.truth(&truth);
                if let (None, Some(first)) = (self.start, self.odometry.points.first()) {
                    self.start = Some((pose, first.pose));
                }
            }
            Odometry::NAME => {
                let Ok(odometry) = bytemuck::try_pod_read_unaligned::<Odometry>(header) else { return };
                let pose = Pose2 { x: odometry.x, y: odometry.y, theta: odometry.theta };
                let owner = self.owner();
                self.odometry.push(pose, owner);
                if let (None, Some(first)) = (self.start, self.truth.points.first()) {
                    self.start = Some((first.pose, pose));
                }
            }
            DecisionHeader::NAME => {
                let Ok(decision) = bytemuck::try_pod_read_unaligned::<DecisionHeader>(header) else { return };
                let verdicts = items.chunks_exact(size_of::<Verdict>());
                self.verdicts.clear();
                self.verdicts.extend(verdicts.map(bytemuck::pod_read_unaligned::<Verdict>));
                let was_halted = self.control.is_halted();
                self.control.decision(&decision, &self.verdicts);
                if self.control.is_halted() && !was_halted {
                    self.halts.push(self.here());
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::{Axes, Mode, Name, Outcome};

    fn send<M: Message>(trace: &mut Trace, header: &M, items: &[M::Item]) {
        let (header, items) = (bytemuck::bytes_of(header), bytemuck::cast_slice(items));
        trace.message("t", &MessageType::of::<M>(), Time::ZERO, header, items);
    }

    #[test]
    fn tracks_owners_and_halts_are_kept() {
        let mut trace = Trace::default();
        let verdict =
            Verdict { behavior: Name::new("wall"), outcome: Outcome::Won.code(), ..Default::default() };
        for step in 0..100_u32 {
            let x = 0.02 * f64::from(step);
            send(&mut trace, &Truth { x: 5.0 + x, y: 1.0, ..Truth::default() }, &[]);
            send(&mut trace, &Odometry { x, ..Odometry::default() }, &[]);
            let mode = if step == 50 { Mode::Halted } else { Mode::Driving };
            let stamp_ns = u64::from(step) * 100_000_000;
            let decision =
                DecisionHeader { stamp_ns, mode: mode.code(), halted: Axes::ALL, ..Default::default() };
            send(&mut trace, &decision, &[verdict]);
        }
        assert_eq!(
            (trace.truth().len(), trace.owners()),
            (100, &["wall".to_owned(), "halted".to_owned()][..])
        );
        let first = trace.odometry()[0].pose;
        assert_eq!((first.x, first.y), (5.0, 1.0), "odometry begins where the truth does");
        let halts = trace.halts();
        assert_eq!((halts.len(), halts[0].pose.x, halts[0].halt.duration_s), (1, 6.0, 0.1));
    }

    #[test]
    fn a_long_track_is_thinned_and_standing_adds_nothing() {
        let mut track = Track::default();
        for step in 0..200_000 {
            track.push(Pose2::new(0.05 * f64::from(step), 0.0, 0.0), None);
            track.push(Pose2::new(0.05 * f64::from(step), 0.0, 0.0), None);
        }
        assert!(track.points().len() <= MAX_POINTS && track.points().len() > MAX_POINTS / 4);
        assert!((track.points()[track.points().len() - 1].pose.x - 10_000.0).abs() < 10.0);
    }
}
