//! What a behavior proposes.

use std::fmt;

use bytemuck::{Pod, Zeroable};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Name, Note, message, vocabulary};
use crate::geometry::{Axis, Twist};
use crate::time::Time;

/// A set of axes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Pod, Zeroable)]
pub struct Axes(u32);

impl Axes {
    /// No axis.
    pub const NONE: Axes = Axes(0);
    /// Forward speed only.
    pub const LINEAR: Axes = Axes(1);
    /// Speed to the left only.
    pub const LATERAL: Axes = Axes(2);
    /// Turn rate only.
    pub const ANGULAR: Axes = Axes(4);
    /// What a differential drive has: forward and turn.
    pub const PLANAR: Axes = Axes(1 | 4);
    /// All three.
    pub const ALL: Axes = Axes(7);

    /// The set that traveled as these bits; `None` where a bit has no axis.
    pub const fn from_bits(bits: u32) -> Option<Axes> {
        if bits <= 7 { Some(Axes(bits)) } else { None }
    }

    /// A bit an axis, [`Axis::Linear`] lowest.
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// Whether `axis` is in the set.
    pub const fn contains(self, axis: Axis) -> bool {
        self.0 & (1 << axis as u32) != 0
    }

    /// In either set.
    pub const fn union(self, other: Axes) -> Axes {
        Axes(self.0 | other.0)
    }

    /// In both sets.
    pub const fn intersection(self, other: Axes) -> Axes {
        Axes(self.0 & other.0)
    }

    /// In this set and not in the other.
    pub const fn without(self, other: Axes) -> Axes {
        Axes(self.0 & !other.0)
    }

    /// Whether there is no axis in it.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether every bit has an axis; what traveled may not.
    pub const fn is_valid(self) -> bool {
        self.0 <= 7
    }

    /// The axes in the set.
    pub fn iter(self) -> impl Iterator<Item = Axis> {
        Axis::ALL.into_iter().filter(move |&axis| self.contains(axis))
    }
}

impl From<Axis> for Axes {
    fn from(axis: Axis) -> Axes {
        Axes(1 << axis as u32)
    }
}

impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.write_str("none");
        }
        for (i, axis) in self.iter().enumerate() {
            if i > 0 {
                f.write_str("+")?;
            }
            f.write_str(axis.as_str())?;
        }
        Ok(())
    }
}

impl Serialize for Axes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Axes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Axes, D::Error> {
        let words = String::deserialize(deserializer)?;
        let found = (0..8).filter_map(Axes::from_bits).find(|axes| axes.to_string() == words);
        found.ok_or_else(|| D::Error::custom(format!("`{words}` are no axes")))
    }
}

vocabulary! {
    /// What a proposal asks for.
    pub enum Kind {
        /// Nothing, and why.
        Abstain = 0 "abstain",
        /// This twist on the axes that it claims.
        Drive = 1 "drive",
        /// No more than these speeds, whoever drives.
        Limit = 2 "limit",
        /// Stop on the axes that it names.
        Halt = 3 "halt",
    }
}

vocabulary! {
    /// Why a behavior proposes what it does: the common words for what was seen, and for what was not.
    pub enum Reason {
        /// None given.
        None = 0 "no reason given",
        /// The behavior does what it is for.
        Nominal = 1 "nominal",
        /// Nothing near.
        Clear = 2 "clear",
        /// Something nearer than a gate.
        Echo = 3 "echo",
        /// An input has never arrived.
        NoInput = 4 "no input",
        /// An input is too old.
        StaleInput = 5 "stale input",
        /// An input has wrong sizes or numbers.
        MalformedInput = 6 "malformed input",
        /// A range sensor fell silent.
        SonarStale = 7 "sonar stale",
        /// Messages were lost on the way.
        Overflow = 8 "overflow",
        /// The behavior panicked and is out until restarted.
        Panicked = 9 "panicked",
        /// Driving on the last good measurement.
        Coasting = 10 "coasting",
        /// Looking around for what was lost.
        Searching = 11 "searching",
        /// Too few line segments in view.
        TooFewSegments = 20 "too few segments",
        /// No vanishing point.
        NoVanishingPoint = 21 "no vanishing point",
        /// Lines parallel in the picture.
        Degenerate = 22 "degenerate",
        /// Two answers equally good.
        Ambiguous = 23 "ambiguous",
        /// Heading uncertain beyond use.
        HeadingLost = 24 "heading lost",
        /// Only the left wall is seen.
        OneWallLeft = 25 "one wall, left",
        /// Only the right wall is seen.
        OneWallRight = 26 "one wall, right",
        /// No wall is seen.
        NoWall = 27 "no wall",
        /// The wall lies across the view.
        EdgeOn = 28 "edge on",
        /// The camera's height is not known.
        NoHeightCalibration = 29 "no height calibration",
        /// The two views do not differ.
        NoParallax = 30 "no parallax",
        /// A line above the camera.
        NegativeHeight = 31 "negative height",
        /// Only one edge of a pair.
        OneSided = 32 "one sided",
        /// A template without contrast.
        FlatTemplate = 33 "flat template",
        /// A match too weak.
        LowCorrelation = 34 "low correlation",
        /// The tracked intersection is gone.
        IntersectionLost = 35 "intersection lost",
        /// Too few matches with the map.
        TooFewMatches = 36 "too few matches",
        /// A measurement outside its gate.
        Gated = 37 "gated",
        /// A covariance too small for what is measured.
        OverConfident = 38 "over-confident",
        /// Measurements contradict each other.
        Inconsistent = 39 "inconsistent",
        /// The pose is lost.
        Lost = 40 "lost",
        /// Older than the history kept.
        TooOld = 41 "too old",
        /// Results out of order.
        OutOfOrder = 42 "out of order",
        /// No threshold was learned here.
        NoThreshold = 43 "no threshold",
        /// A threshold that sees too few edges.
        LowRecall = 44 "low recall",
        /// Nothing of the map is in view.
        NoModel = 45 "no model",
        /// Picture and map do not register.
        MisRegistered = 46 "mis-registered",
        /// No way through.
        PassageBlocked = 47 "passage blocked",
        /// Floor and obstacles look alike.
        LowContrast = 48 "low contrast",
        /// The floor looks like an obstacle.
        FloorModelBroken = 49 "floor model broken",
        /// A wall nearer than is safe.
        WallNear = 50 "wall near",
    }
}

/// A sector of directions of translation, robot frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize)]
pub struct Sector {
    /// Middle, left positive, radians.
    pub center_rad: f64,
    /// Half width, radians; pi or more is every direction.
    pub half_width_rad: f64,
}

impl Sector {
    /// Every direction.
    pub const ALL: Sector = Sector { center_rad: 0.0, half_width_rad: std::f64::consts::PI };
}

message! {
    /// What one behavior proposes at one instant.
    ///
    /// Made with [`Proposal::drive`], [`Proposal::limit`], [`Proposal::halt`] or [`Proposal::abstain`]. The shell around
    /// the behavior fills in who proposes, the sequence, the stamp and the priority.
    "yamabico.Proposal.v2" Latest [u8] evidence evidence_ns
    pub struct Proposal {
        /// Who proposes; filled in by the shell.
        pub behavior: Name,
        /// Counts up by one a proposal; filled in by the shell.
        pub sequence: u64,
        /// The instant of the world's state that it rests on; the shell fills in "now" where it is zero.
        pub stamp_ns: u64,
        /// Oldest sensor data in it; the shell fills in "now" where it is zero.
        pub evidence_ns: u64,
        /// When the behavior was handed what it rests on; filled in by the shell.
        pub received_ns: u64,
        /// When it was sent; filled in by the shell.
        pub proposed_ns: u64,
        /// From the task file, higher wins; filled in by the shell.
        pub priority: i32,
        /// A [`Kind`] code.
        pub kind: u32,
        /// Claimed by a drive, stopped by a halt, limited by a limit.
        pub axes: Axes,
        /// Not zero: having lost one axis it gives up all.
        pub coupled: u32,
        /// What a drive asks for.
        pub twist: Twist,
        /// Largest magnitude that a limit allows on each of its axes, m/s, m/s, rad/s.
        pub limits: Twist,
        /// Where a limit counts: only while the commanded translation points into it.
        pub sector: Sector,
        /// 0 to 1, for blending.
        pub confidence: f64,
        /// A [`Reason`] code.
        pub reason: u32,
        /// Zero.
        pub reserved: u32,
        /// The reason in words with numbers.
        pub note: Note,
    }
}

impl Proposal {
    fn new(kind: Kind, axes: Axes, reason: Reason) -> Proposal {
        Proposal {
            kind: kind.code(),
            axes,
            coupled: 1,
            sector: Sector::ALL,
            confidence: 1.0,
            reason: reason.code(),
            ..Proposal::default()
        }
    }

    /// Drive with `twist` on `axes`.
    pub fn drive(axes: Axes, twist: Twist) -> Proposal {
        Proposal { twist, ..Proposal::new(Kind::Drive, axes, Reason::Nominal) }
    }

    /// Allow no more than `limits` on `axes`, in every direction.
    pub fn limit(axes: Axes, limits: Twist, reason: Reason) -> Proposal {
        Proposal { limits, ..Proposal::new(Kind::Limit, axes, reason) }
    }

    /// Stop on `axes`.
    pub fn halt(axes: Axes, reason: Reason) -> Proposal {
        Proposal::new(Kind::Halt, axes, reason)
    }

    /// Propose nothing.
    pub fn abstain(reason: Reason) -> Proposal {
        Proposal::new(Kind::Abstain, Axes::NONE, reason)
    }

    /// With the stamp of the oldest sensor data that it rests on.
    pub fn with_evidence(mut self, evidence: Time) -> Proposal {
        self.evidence_ns = evidence.0;
        self
    }

    /// With a confidence from 0 to 1.
    pub fn with_confidence(mut self, confidence: f64) -> Proposal {
        self.confidence = confidence;
        self
    }

    /// With another reason.
    pub fn because(mut self, reason: Reason) -> Proposal {
        self.reason = reason.code();
        self
    }

    /// With words; what does not fit is left out. Formats in place, without allocating.
    pub fn with_note(mut self, words: fmt::Arguments<'_>) -> Proposal {
        use fmt::Write;
        self.note = Note::default();
        // Writing to a `Text` cuts and never fails.
        let _ = self.note.write_fmt(words);
        self
    }

    /// Keeps each axis that it wins, whatever becomes of the others.
    pub fn uncoupled(mut self) -> Proposal {
        self.coupled = 0;
        self
    }

    /// A limit that counts only for translation into `sector`.
    pub fn in_sector(mut self, sector: Sector) -> Proposal {
        self.sector = sector;
        self
    }

    /// What it asks for, where the code is known.
    pub fn kind(&self) -> Option<Kind> {
        Kind::from_code(self.kind)
    }

    /// Why, where the code is known.
    pub fn reason(&self) -> Option<Reason> {
        Reason::from_code(self.reason)
    }
}
