//! Records of a live run from which it can be replayed: what each call was handed, and what the arbiter heard.

use super::{Name, code_enum, item, message};

code_enum! {
    /// Event in the life of a behavior.
    pub enum CallEvent {
        /// A call of `propose`.
        Call = 0 "call",
        /// Start of an instance in a new process or thread.
        Start = 1 "start",
        /// Replacement of the instance by one with other parameters.
        Retune = 2 "retune",
    }
}

message! {
    /// A call of a behavior, or another event in its life. Its items are the messages that the call was handed for the
    /// first time; it has the others of its slots from earlier calls.
    "yamabico.CallHeader.v1" Stream [CallInput]
    pub struct CallHeader {
        /// Time of the event; for a call, the `now` that the behavior saw.
        pub stamp_ns: u64,
        /// Sequence number since the behavior's last start.
        pub sequence: u64,
        /// Name of the behavior.
        pub behavior: Name,
        /// Sequence number of the proposal; zero if the call panicked, and for other events.
        pub proposal: u64,
        /// Request of the parameters, for a [`CallEvent::Retune`] or a [`CallEvent::Start`]; zero for those of the task file, and
        /// for other events.
        pub request: u64,
        /// Hash of the restored state, for a [`CallEvent::Start`], see [`state_hash`]; zero if none was restored.
        pub state: u64,
        /// A [`CallEvent`] code.
        pub event: u32,
        /// Number of inputs that did not fit into this record; their call cannot be replayed.
        pub left_out: u32,
    }
}

impl CallHeader {
    /// Returns the event, or `None` if the code is undefined.
    pub fn event(&self) -> Option<CallEvent> {
        CallEvent::from_code(self.event)
    }
}

item! {
    /// A message that a call was handed for the first time.
    pub struct CallInput {
        /// Index of the slot among the behavior's connected slots.
        pub slot: u32,
        /// Zero if it was received before the call, such as while the behavior slept, and is not fresh.
        pub fresh: u32,
        /// Sequence number of the message.
        pub sequence: u64,
        /// Stamp of the message.
        pub stamp_ns: u64,
    }
}

/// Returns the hash of a saved state in a [`CallHeader`]: 64-bit FNV-1a, zero for an empty state.
#[must_use]
pub fn state_hash(state: &[u8]) -> u64 {
    const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0100_0000_01b3;
    if state.is_empty() {
        return 0;
    }
    state.iter().fold(OFFSET, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(PRIME))
}

code_enum! {
    /// Kind of something that the arbiter heard.
    pub enum HeardKind {
        /// The newest proposal of a behavior.
        Proposal = 0 "proposal",
        /// The newest measurement of a critical sensor.
        Sensor = 1 "sensor",
        /// A request of an operator.
        Control = 2 "control",
        /// The request to bring the robot to a standstill for the end of the run.
        ShutDown = 3 "shut down",
    }
}

message! {
    /// A decision of the arbiter with the times that it read. Its items are what it heard before, in this order.
    "yamabico.HeardHeader.v1" Stream [Heard]
    pub struct HeardHeader {
        /// Time of the decision.
        pub stamp_ns: u64,
        /// Sequence number of the decision.
        pub sequence: u64,
        /// Time at which the command was sent.
        pub sent_ns: u64,
        /// Number of items that did not fit into this record; the decision cannot be replayed.
        pub left_out: u64,
    }
}

item! {
    /// Something that the arbiter heard.
    pub struct Heard {
        /// A [`HeardKind`] code.
        pub kind: u32,
        /// Index of the behavior or critical sensor in the policy; zero for other kinds.
        pub index: u32,
        /// Sequence number of the message; zero for a sensor.
        pub sequence: u64,
        /// Stamp of the message.
        pub stamp_ns: u64,
        /// Time at which it was heard.
        pub heard_ns: u64,
    }
}

impl Heard {
    /// Returns the kind, or `None` if the code is undefined.
    pub fn kind(&self) -> Option<HeardKind> {
        HeardKind::from_code(self.kind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_has_its_known_values() {
        assert_eq!((state_hash(b""), state_hash(b"a")), (0, 0xaf63_dc4c_8601_ec8c));
        assert_eq!(state_hash(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
