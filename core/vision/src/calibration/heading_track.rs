//! Turns of a robot, by pictures and by odometry.

/// Turn between two pictures, by their stamps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedTurn {
    /// Stamp of the earlier picture, s.
    pub from_s: f64,
    /// Stamp of the later picture, s.
    pub to_s: f64,
    /// Turn between them, rad, positive to the left.
    pub turn: f64,
}

/// Heading by odometry, which grows beyond a whole turn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeadingTrack {
    stamps_s: Vec<f64>,
    headings: Vec<f64>,
}

impl TimedTurn {
    /// Turn rate, rad/s.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.turn / (self.to_s - self.from_s)
    }
}

impl HeadingTrack {
    /// Appends a heading, rad; one that is not newer than the last, or not finite, is left out.
    pub fn push(&mut self, stamp_s: f64, heading: f64) {
        let is_newer = self.stamps_s.last().is_none_or(|last| stamp_s > *last);
        if !is_newer || !stamp_s.is_finite() || !heading.is_finite() {
            return;
        }
        let last = self.headings.last().copied().unwrap_or(heading);
        self.stamps_s.push(stamp_s);
        self.headings.push(last + yamabico_geometry::wrap_angle(heading - last));
    }

    /// Heading at a time, interpolated; `None` outside of the track.
    #[must_use]
    pub fn at(&self, seconds: f64) -> Option<f64> {
        let after = self.stamps_s.partition_point(|stamp| *stamp < seconds);
        if after < self.stamps_s.len() && self.stamps_s[after] == seconds {
            return Some(self.headings[after]);
        }
        let before = after.checked_sub(1).filter(|_| after < self.stamps_s.len())?;
        let share = (seconds - self.stamps_s[before]) / (self.stamps_s[after] - self.stamps_s[before]);
        Some(self.headings[before] + share * (self.headings[after] - self.headings[before]))
    }

    /// Number of headings.
    #[must_use]
    pub fn len(&self) -> usize {
        self.headings.len()
    }

    /// Returns true without headings.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.headings.is_empty()
    }

    /// Turn rate by odometry in the time of a turn between pictures if their stamps are late by `offset_s`, rad/s; `None` outside of the track.
    #[must_use]
    pub fn rate(&self, seen: &TimedTurn, offset_s: f64) -> Option<f64> {
        let turn = self.at(seen.to_s - offset_s)? - self.at(seen.from_s - offset_s)?;
        Some(turn / (seen.to_s - seen.from_s))
    }
}
