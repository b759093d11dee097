//! The newest message of a topic, and the proposals that follow from it.

use std::fmt;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use yamabico_core::message::{Axes, Proposal, Reason, Twist};
use yamabico_core::time::Time;

/// State of a subscription.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Link {
    /// The topic has no publisher.
    #[default]
    NoPublisher,
    /// It is published with another type.
    OtherType,
    /// It is published with another quality of service.
    QosMismatch,
    /// A publisher matches.
    Matched,
}

/// A message that was received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heard<T> {
    /// Contents.
    pub value: T,
    /// Time at which it was sent or stamped.
    pub captured: Time,
    /// Time of its arrival.
    pub arrival: Time,
}

/// The newest message of a topic, shared by the thread that receives it.
#[derive(Debug)]
pub struct Reception<T> {
    /// Name of the topic.
    pub topic: String,
    state: Mutex<(Option<Heard<T>>, Link)>,
}

impl<T: Copy> Reception<T> {
    /// Returns a topic without a message.
    #[must_use]
    pub fn new(topic: &str) -> Reception<T> {
        Reception { topic: topic.to_owned(), state: Mutex::new((None, Link::default())) }
    }

    /// Replaces the newest message.
    pub fn hear(&self, heard: Heard<T>) {
        self.locked().0 = Some(heard);
    }

    /// Sets the state of the subscription.
    pub fn set_link(&self, link: Link) {
        self.locked().1 = link;
    }

    /// Returns the newest message, and the state of the subscription.
    #[must_use]
    pub fn newest(&self) -> (Option<Heard<T>>, Link) {
        *self.locked()
    }

    fn locked(&self) -> MutexGuard<'_, (Option<Heard<T>>, Link)> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Reason why a topic is silent, short enough for a note.
struct Silence<'a> {
    topic: &'a str,
    link: Link,
    age_s: Option<f64>,
}

impl fmt::Display for Silence<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let topic = self.topic;
        match (self.link, self.age_s) {
            (Link::OtherType, _) => write!(f, "other type on {topic}"),
            (Link::QosMismatch, _) => write!(f, "QoS mismatch on {topic}"),
            (Link::Matched, None) => write!(f, "no message yet on {topic}"),
            (Link::Matched, Some(age_s)) => write!(f, "no message for {age_s:.1} s on {topic}"),
            (Link::NoPublisher, None) => write!(f, "no publisher of {topic}"),
            (Link::NoPublisher, Some(age_s)) => write!(f, "publisher lost {age_s:.1} s ago: {topic}"),
        }
    }
}

/// Proposes the newest velocity of a topic at the time `now` on `axes`; abstains once it is older than `timeout`.
#[must_use]
pub fn velocity(reception: &Reception<Twist>, timeout: Duration, axes: Axes, now: Time) -> Proposal {
    let (heard, link) = reception.newest();
    let topic = reception.topic.as_str();
    let Some(Heard { value, captured, arrival }) = heard else {
        let silence = Silence { topic, link, age_s: None };
        return Proposal::abstain(Reason::NoInput).with_evidence(now).with_note(format_args!("{silence}"));
    };
    if now.since(arrival) > timeout {
        let silence = Silence { topic, link, age_s: Some(now.seconds_after(arrival)) };
        return Proposal::abstain(Reason::StaleInput).with_evidence(now).with_note(format_args!("{silence}"));
    }
    Proposal::drive(axes, value).with_evidence(captured.min(now)).with_note(format_args!("{topic}"))
}

/// Proposes to stand on `axes` while the topic of a lock says true, and while it is silent for longer than `timeout`, if there
/// is one; abstains while it is open.
#[must_use]
pub fn lock(reception: &Reception<bool>, timeout: Option<Duration>, axes: Axes, now: Time) -> Proposal {
    let (heard, link) = reception.newest();
    let topic = reception.topic.as_str();
    let stand = || Proposal::drive(axes, Twist::ZERO).with_evidence(now);
    let is_expired = |arrival: Time| timeout.is_some_and(|timeout| now.since(arrival) > timeout);
    match heard {
        Some(Heard { value: true, .. }) => stand().with_note(format_args!("locked by {topic}")),
        Some(Heard { arrival, .. }) if is_expired(arrival) => {
            let silence = Silence { topic, link, age_s: Some(now.seconds_after(arrival)) };
            stand().with_reason(Reason::StaleInput).with_note(format_args!("locked: {silence}"))
        }
        None if timeout.is_some() => {
            let silence = Silence { topic, link, age_s: None };
            stand().with_reason(Reason::NoInput).with_note(format_args!("locked: {silence}"))
        }
        _ => Proposal::abstain(Reason::Clear).with_evidence(now).with_note(format_args!("{topic} is open")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yamabico_core::message::Kind;

    const AXES: Axes = Axes::PLANAR;

    fn heard<T>(value: T, arrival_s: f64) -> Heard<T> {
        let arrival = Time::from_secs_f64(arrival_s);
        Heard { value, captured: arrival - Duration::from_millis(10), arrival }
    }

    #[test]
    fn a_velocity_drives_until_its_timeout_and_says_why_it_stops() {
        let topic = Reception::new("/cmd_vel_nav");
        let at = |now_s: f64| velocity(&topic, Duration::from_millis(500), AXES, Time::from_secs_f64(now_s));
        assert_eq!(at(1.0).kind(), Some(Kind::Abstain));
        assert_eq!(at(1.0).note.as_str(), "no publisher of /cmd_vel_nav");
        topic.set_link(Link::Matched);
        topic.hear(heard(Twist::planar(0.2, 0.1), 2.0));
        let proposal = at(2.4);
        assert_eq!((proposal.kind(), proposal.twist), (Some(Kind::Drive), Twist::planar(0.2, 0.1)));
        assert_eq!(proposal.evidence_ns, Time::from_secs_f64(1.99).0);
        assert_eq!(at(2.7).note.as_str(), "no message for 0.7 s on /cmd_vel_nav");
        topic.set_link(Link::NoPublisher);
        assert_eq!(at(2.7).note.as_str(), "publisher lost 0.7 s ago: /cmd_vel_nav");
        assert_eq!(at(2.7).kind(), Some(Kind::Abstain));
    }

    #[test]
    fn a_lock_stands_when_closed_and_when_silent() {
        let topic = Reception::new("/pause");
        let timeout = Some(Duration::from_millis(500));
        let at = |timeout, now_s: f64| lock(&topic, timeout, AXES, Time::from_secs_f64(now_s));
        let stands =
            |proposal: Proposal| proposal.kind() == Some(Kind::Drive) && proposal.twist == Twist::ZERO;
        assert!(stands(at(timeout, 1.0)) && !stands(at(None, 1.0)), "before the first message");
        topic.hear(heard(false, 1.0));
        assert!(!stands(at(timeout, 1.4)) && stands(at(timeout, 1.6)) && !stands(at(None, 9.0)));
        topic.hear(heard(true, 2.0));
        assert!(stands(at(timeout, 2.1)) && stands(at(timeout, 9.0)) && stands(at(None, 9.0)));
    }
}
