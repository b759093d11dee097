//! The proposal: what one behavior asks the robot to do.

use std::fmt;

use bytemuck::{Pod, Zeroable};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Name, Note, code_enum, message};
use crate::geometry::{Axis, Twist};
use crate::time::Time;

/// A set of motion axes.
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
    /// Forward speed and turn rate: the axes of a differential drive.
    pub const PLANAR: Axes = Axes(1 | 4);
    /// All three axes.
    pub const ALL: Axes = Axes(7);

    /// Decodes a bit mask; `None` if it has an undefined bit.
    pub const fn from_bits(bits: u32) -> Option<Axes> {
        if bits <= 7 { Some(Axes(bits)) } else { None }
    }

    /// Bit mask with [`Axis::Linear`] in the lowest bit.
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// Returns true if `axis` is in the set.
    pub const fn contains(self, axis: Axis) -> bool {
        self.0 & (1 << axis as u32) != 0
    }

    /// Returns the axes in either set.
    pub const fn union(self, other: Axes) -> Axes {
        Axes(self.0 | other.0)
    }

    /// Returns the axes in both sets.
    pub const fn intersection(self, other: Axes) -> Axes {
        Axes(self.0 & other.0)
    }

    /// Returns the axes in this set that are not in `other`.
    pub const fn without(self, other: Axes) -> Axes {
        Axes(self.0 & !other.0)
    }

    /// Returns true if the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Returns true if no undefined bit is set; a received set may be invalid.
    pub const fn is_valid(self) -> bool {
        self.0 <= 7
    }

    /// Reads the names of axes in their order, such as `linear+angular`, or `none`.
    #[must_use]
    pub fn from_names(text: &str) -> Option<Axes> {
        let with = |axes: Axes, name: &str| {
            let axis = Axes::from(Axis::ALL.into_iter().find(|axis| axis.as_str() == name)?);
            (axes.bits() < axis.bits()).then(|| axes.union(axis))
        };
        if text == "none" { Some(Axes::NONE) } else { text.split('+').try_fold(Axes::NONE, with) }
    }

    /// Iterates over the axes in the set.
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
        let text = String::deserialize(deserializer)?;
        Axes::from_names(&text).ok_or_else(|| {
            D::Error::custom(format!("`{text}` is not a set of axes such as `linear+angular`"))
        })
    }
}

code_enum! {
    /// Kind of a proposal.
    pub enum Kind {
        /// No motion, with a reason.
        Abstain = 0 "abstain",
        /// Drive with a twist on the claimed axes.
        Drive = 1 "drive",
        /// Limit the speed of all behaviors on the named axes.
        Limit = 2 "limit",
        /// Stop on the named axes.
        Halt = 3 "halt",
    }
}

code_enum! {
    /// Reason of a proposal.
    pub enum Reason {
        /// No reason given.
        None = 0 "no reason given",
        /// Normal operation.
        Nominal = 1 "nominal",
        /// No obstacle near.
        Clear = 2 "clear",
        /// An obstacle within the gate distance.
        Echo = 3 "echo",
        /// An input has never arrived.
        NoInput = 4 "no input",
        /// An input is too old.
        StaleInput = 5 "stale input",
        /// An input has an invalid size or invalid values.
        MalformedInput = 6 "malformed input",
        /// A range sensor stopped sending.
        SonarStale = 7 "sonar stale",
        /// Messages were lost to buffer overflow.
        Overflow = 8 "overflow",
        /// The behavior panicked and is disabled until it is restarted.
        Panicked = 9 "panicked",
        /// Driving on the last good measurement.
        Coasting = 10 "coasting",
        /// Turning to find a lost target again.
        Searching = 11 "searching",
        /// Too few line segments in view.
        TooFewSegments = 20 "too few segments",
        /// No vanishing point found.
        NoVanishingPoint = 21 "no vanishing point",
        /// All lines are parallel in the image.
        Degenerate = 22 "degenerate",
        /// Two solutions are equally good.
        Ambiguous = 23 "ambiguous",
        /// Heading too uncertain to drive by.
        HeadingLost = 24 "heading lost",
        /// Only the left wall is visible.
        OneWallLeft = 25 "one wall, left",
        /// Only the right wall is visible.
        OneWallRight = 26 "one wall, right",
        /// No wall is visible.
        NoWall = 27 "no wall",
        /// The wall lies across the view.
        EdgeOn = 28 "edge-on",
        /// The camera's height is unknown.
        NoHeightCalibration = 29 "no height calibration",
        /// The two views have no parallax.
        NoParallax = 30 "no parallax",
        /// A wall line lies above the camera.
        NegativeHeight = 31 "negative height",
        /// Only one edge of a pair was found.
        OneSided = 32 "one-sided",
        /// The template has no contrast.
        FlatTemplate = 33 "flat template",
        /// The correlation of the best match is too low.
        LowCorrelation = 34 "low correlation",
        /// The tracked intersection was lost.
        IntersectionLost = 35 "intersection lost",
        /// Too few matches with the map.
        TooFewMatches = 36 "too few matches",
        /// The measurement lies outside its gate.
        Gated = 37 "gated",
        /// The covariance is too small for the measured error.
        Overconfident = 38 "overconfident",
        /// Measurements contradict each other.
        Inconsistent = 39 "inconsistent",
        /// The pose is lost.
        Lost = 40 "lost",
        /// The measurement is older than the stored history.
        TooOld = 41 "too old",
        /// Results arrived out of order.
        OutOfOrder = 42 "out of order",
        /// No threshold has been learned for this place.
        NoThreshold = 43 "no threshold",
        /// The learned threshold finds too few of the edges.
        LowRecall = 44 "low recall",
        /// No part of the map is in view.
        NoModel = 45 "no model",
        /// Image and map do not register.
        MisRegistered = 46 "misregistered",
        /// The passage is blocked.
        PassageBlocked = 47 "passage blocked",
        /// Floor and obstacles have similar colors.
        LowContrast = 48 "low contrast",
        /// The floor model classifies the floor as an obstacle.
        FloorModelBroken = 49 "floor model invalid",
        /// A wall is nearer than is safe.
        WallNear = 50 "wall near",
        /// No corridor is in view.
        NoCorridor = 51 "no corridor",
        /// A wall lies across the way.
        WallAhead = 52 "wall ahead",
        /// The corridor ends.
        CorridorEnds = 53 "corridor ends",
    }
}

/// A sector of directions of translation in the robot frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize)]
pub struct Sector {
    /// Direction of the center, rad, positive to the left.
    pub center_rad: f64,
    /// Half of the opening angle, rad; pi or more covers every direction.
    pub half_width_rad: f64,
}

impl Sector {
    /// Every direction.
    pub const ALL: Sector = Sector { center_rad: 0.0, half_width_rad: std::f64::consts::PI };
}

message! {
    /// A proposal of one behavior.
    ///
    /// Create one with [`Proposal::drive`], [`Proposal::limit`], [`Proposal::halt`] or [`Proposal::abstain`]. The host
    /// fills in name, sequence number, stamps and priority before it publishes the proposal.
    "yamabico.Proposal.v2" Latest [u8] evidence evidence_ns
    pub struct Proposal {
        /// Name of the behavior; filled in by the host.
        pub behavior: Name,
        /// Sequence number; filled in by the host.
        pub sequence: u64,
        /// Time that the proposal is valid for; if zero, the host fills in the current time.
        pub stamp_ns: u64,
        /// Stamp of the oldest sensor data behind it; if zero, the host fills in the oldest stamp among the inputs.
        pub evidence_ns: u64,
        /// Time at which the behavior received its inputs; filled in by the host.
        pub received_ns: u64,
        /// Time at which the proposal was sent; filled in by the host.
        pub proposed_ns: u64,
        /// Priority from the task file, higher wins; filled in by the host.
        pub priority: i32,
        /// A [`Kind`] code.
        pub kind: u32,
        /// Axes that a drive claims, a halt stops or a limit restricts.
        pub axes: Axes,
        /// Nonzero if a drive that loses one of its axes gives up all of them.
        pub coupled: u32,
        /// Twist of a drive.
        pub twist: Twist,
        /// Maximum speeds of a limit, as magnitudes: m/s, m/s, rad/s.
        pub limits: Twist,
        /// Sector of a limit: it applies only while the commanded translation points into the sector.
        pub sector: Sector,
        /// Confidence from 0 to 1, for blending.
        pub confidence: f64,
        /// A [`Reason`] code.
        pub reason: u32,
        /// Zero.
        pub reserved: u32,
        /// Explanation with numbers.
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

    /// Proposes to drive with `twist` on `axes`.
    pub fn drive(axes: Axes, twist: Twist) -> Proposal {
        Proposal { twist, ..Proposal::new(Kind::Drive, axes, Reason::Nominal) }
    }

    /// Limits the speeds on `axes` to `limits`, in every direction.
    pub fn limit(axes: Axes, limits: Twist, reason: Reason) -> Proposal {
        Proposal { limits, ..Proposal::new(Kind::Limit, axes, reason) }
    }

    /// Stops the robot on `axes`.
    pub fn halt(axes: Axes, reason: Reason) -> Proposal {
        Proposal::new(Kind::Halt, axes, reason)
    }

    /// Proposes no motion.
    pub fn abstain(reason: Reason) -> Proposal {
        Proposal::new(Kind::Abstain, Axes::NONE, reason)
    }

    /// Sets the stamp of the oldest sensor data behind the proposal.
    pub fn with_evidence(mut self, evidence: Time) -> Proposal {
        self.evidence_ns = evidence.0;
        self
    }

    /// Sets the confidence, 0 to 1.
    pub fn with_confidence(mut self, confidence: f64) -> Proposal {
        self.confidence = confidence;
        self
    }

    /// Sets the reason.
    pub fn with_reason(mut self, reason: Reason) -> Proposal {
        self.reason = reason.code();
        self
    }

    /// Sets the explanation, truncated to 64 bytes. Formats in place, without allocation.
    pub fn with_note(mut self, text: fmt::Arguments<'_>) -> Proposal {
        use fmt::Write;
        self.note = Note::default();
        // Writing to a `Text` truncates and never fails.
        let _ = self.note.write_fmt(text);
        self
    }

    /// Makes a drive keep the axes that it wins even if it loses others.
    pub fn uncoupled(mut self) -> Proposal {
        self.coupled = 0;
        self
    }

    /// Makes a limit apply only to translation into `sector`.
    pub fn in_sector(mut self, sector: Sector) -> Proposal {
        self.sector = sector;
        self
    }

    /// Returns the kind, or `None` if the code is undefined.
    pub fn kind(&self) -> Option<Kind> {
        Kind::from_code(self.kind)
    }

    /// Returns the reason, or `None` if the code is undefined.
    pub fn reason(&self) -> Option<Reason> {
        Reason::from_code(self.reason)
    }
}
