//! Steering toward the middle between the two edges.

use yamabico_core::geometry::Twist;
use yamabico_core::message::{Axes, Proposal, Reason};

use crate::config::Config;
use crate::finder::Side;
use crate::landmarks::Ahead;
use crate::track::{IntersectionTrack, Sides};

/// Returns true if the tracked edges were confirmed by the ends of the walls often enough.
pub fn is_confirmed(track: &IntersectionTrack, config: &Config) -> bool {
    track.confirmations() >= config.confirm_frames
}

/// Proposes to drive toward the middle `ahead`, or abstains with the reason.
pub fn steer(ahead: &Ahead, track: &IntersectionTrack, config: &Config) -> Proposal {
    let note = format_args!(
        "{:.1} m ahead +- {:.2}, {:+.1} degrees",
        ahead.distance_m,
        ahead.sigma_m,
        ahead.bearing.to_degrees()
    );
    if !is_confirmed(track, config) {
        let reason = match track.sides() {
            Sides::Both => Reason::Searching,
            _ => Reason::OneSided,
        };
        return Proposal::abstain(reason).with_note(note);
    }
    if track.sides() != Sides::Both {
        return Proposal::abstain(Reason::OneSided).with_note(note);
    }
    let is_seen = Side::BOTH.iter().any(|&side| track.observed_at(side).is_some());
    let (share, reason) = match track.needs_ends() {
        _ if !is_seen => (0.5, Reason::Coasting),
        true => (0.5, Reason::OneSided),
        false => (1.0, Reason::Nominal),
    };
    let speed = share * config.speed_mps * (1.0 - ahead.bearing.abs() / 0.5).max(0.3);
    let max_turn = config.max_turn_radps;
    let turn = (config.turn_gain * ahead.bearing).clamp(-max_turn, max_turn);
    Proposal::drive(Axes::PLANAR, Twist::planar(speed, turn)).with_reason(reason).with_note(note)
}
