//! One node, the topics that it knows, and the settings that every process of a robot shares.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{
    Alignment, FileName, LogLevel, MessagingPattern, Path, PortFactory as _, SemanticString, Service,
    ServiceName, SignalHandlingMode, set_log_level_from_env_or,
};
use iceoryx2::service::attribute::{AttributeKey, AttributeSpecifier, AttributeValue};
use iceoryx2::service::builder::event::EventOpenError;
use iceoryx2::service::builder::publish_subscribe::{
    Builder, PublishSubscribeCreateError, PublishSubscribeOpenError,
};
use iceoryx2::service::marker::CustomHeaderMarker;
use iceoryx2::service::port_factory::event::PortFactory as EventFactory;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};

use super::{Bell, BusError, Spec};
use yamabico_core::message::{Channel, MessageType};

pub(super) type Topic<S> = PortFactory<S, [u8], CustomHeaderMarker>;

/// Whether a plugin may have to wait for what its supervisor is about to create.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Patience {
    /// What is not there is not going to be.
    None,
    /// Tries again, but begins no attempt after half a second.
    Bounded,
}

/// A node of the transport with its topics.
pub(super) struct World<S: Service> {
    config: Config,
    patience: Patience,
    inside: Mutex<Inside<S>>,
}

struct Inside<S: Service> {
    topics: HashMap<String, Topic<S>>,
    bells: HashMap<String, EventFactory<S>>,
    node: Node<S>,
}

/// Nodes, dead ones included, that may know a topic.
pub(super) const MAX_NODES: usize = 64;
const LIST_BYTES: &str = "yamabico.list_bytes";
const RINGS: &str = "yamabico.rings";
const LONGEST: Duration = Duration::from_millis(500);
const PAUSE: Duration = Duration::from_millis(25);

impl<S: Service> World<S> {
    pub(super) fn new(
        name: &str,
        root: &str,
        prefix: &str,
        patience: Patience,
    ) -> Result<World<S>, BusError> {
        set_log_level_from_env_or(LogLevel::Fatal);
        let config = settings(root, prefix).map_err(|reason| BusError::transport("set up", name, reason))?;
        let node = patience.retry(
            || {
                NodeBuilder::new()
                    .config(&config)
                    .signal_handling_mode(SignalHandlingMode::Disabled)
                    .create::<S>()
            },
            |_| true,
        );
        let node = node.map_err(|reason| BusError::transport("join", name, reason))?;
        Ok(World {
            config,
            patience,
            inside: Mutex::new(Inside { topics: HashMap::new(), bells: HashMap::new(), node }),
        })
    }

    pub(super) fn create(&self, topic: &str, message: &MessageType, spec: &Spec) -> Result<(), BusError> {
        let failed = |reason: &dyn std::fmt::Debug| BusError::transport("create topic", topic, reason);
        let mut inside = self.inside();
        let rings = spec.bell == Bell::Rings;
        let mut limits = AttributeSpecifier::new();
        for (key, value) in [(LIST_BYTES, spec.list_bytes.to_string()), (RINGS, rings.to_string())] {
            let key = AttributeKey::try_from(key).map_err(|e| failed(&e))?;
            let value = AttributeValue::try_from(value.as_str()).map_err(|e| failed(&e))?;
            limits = limits.define(&key, &value).map_err(|e| failed(&e))?;
        }
        let created = builder(&inside.node, topic, message)?
            .max_publishers(spec.publishers)
            .max_subscribers(spec.subscribers)
            .max_nodes(MAX_NODES)
            .subscriber_max_buffer_size(spec.depth.max(ordinary_depth(message.channel)))
            .subscriber_max_borrowed_samples(max_held(message.channel))
            .history_size(history(message.channel))
            .enable_safe_overflow(true)
            .create_with_attributes(&limits);
        let factory = created.map_err(|e| match e {
            PublishSubscribeCreateError::AlreadyExists => BusError::Exists { topic: topic.into() },
            e => failed(&e),
        })?;
        if rings {
            let bell = inside
                .node
                .service_builder(&service_name(topic)?)
                .event()
                .max_notifiers(spec.publishers)
                .max_listeners(spec.subscribers)
                .max_nodes(MAX_NODES)
                .create()
                .map_err(|e| BusError::transport("create the bell of", topic, e))?;
            inside.bells.insert(topic.into(), bell);
        }
        inside.topics.insert(topic.into(), factory);
        Ok(())
    }

    /// Removes what dead nodes left: how many it was done for, and for how many it failed. May block.
    pub(super) fn clean_dead_nodes(&self) -> (u64, u64) {
        let state = self.inside().node.try_cleanup_dead_nodes();
        (state.cleanups, state.failed_cleanups)
    }

    /// Runs `work` on the topic, which is opened where it is not known yet.
    pub(super) fn with_topic<R>(
        &self,
        topic: &str,
        message: &MessageType,
        work: impl FnOnce(&Topic<S>) -> Result<R, BusError>,
    ) -> Result<R, BusError> {
        let mut inside = self.inside();
        if !inside.topics.contains_key(topic) {
            let opened = self.open(&inside.node, topic, message)?;
            inside.topics.insert(topic.into(), opened);
        }
        let Some(factory) = inside.topics.get(topic) else {
            return Err(BusError::NoSuchTopic { topic: topic.into() });
        };
        let carries = factory.static_config().message_type_details().user_header.type_name().to_string();
        if carries != message.name {
            return Err(BusError::WrongType { topic: topic.into(), carries, asked: message.name });
        }
        work(factory)
    }

    /// Runs `work` on the bell of the topic, which is opened where it is not known yet.
    pub(super) fn with_bell<R>(
        &self,
        topic: &str,
        work: impl FnOnce(&EventFactory<S>) -> Result<R, BusError>,
    ) -> Result<R, BusError> {
        let mut inside = self.inside();
        if !inside.bells.contains_key(topic) {
            let name = service_name(topic)?;
            let opened = self.patience.retry(|| inside.node.service_builder(&name).event().open(), |_| true);
            let opened = opened.map_err(|e| match e {
                EventOpenError::DoesNotExist => BusError::Silent { topic: topic.into() },
                e => BusError::transport("open the bell of", topic, e),
            })?;
            inside.bells.insert(topic.into(), opened);
        }
        match inside.bells.get(topic) {
            Some(bell) => work(bell),
            None => Err(BusError::Silent { topic: topic.into() }),
        }
    }

    fn open(&self, node: &Node<S>, topic: &str, message: &MessageType) -> Result<Topic<S>, BusError> {
        use PublishSubscribeOpenError as E;
        let builder = builder(node, topic, message)?;
        let final_answer = |e: &E| matches!(e, E::IncompatibleTypes | E::InsufficientPermissions);
        self.patience.retry(|| builder.clone().open(), |e| !final_answer(e)).map_err(|e| match e {
            E::DoesNotExist => BusError::NoSuchTopic { topic: topic.into() },
            E::IncompatibleTypes => BusError::WrongType {
                topic: topic.into(),
                carries: self.carried_by(topic),
                asked: message.name,
            },
            e => BusError::transport("open topic", topic, e),
        })
    }

    fn carried_by(&self, topic: &str) -> String {
        let details = ServiceName::new(topic).ok().and_then(|name| {
            S::details(&name, &self.config, MessagingPattern::PublishSubscribe).ok().flatten()
        });
        match details.as_ref().map(|details| details.static_details.messaging_pattern()) {
            Some(
                iceoryx2::service::static_config::messaging_pattern::MessagingPattern::PublishSubscribe(
                    pattern,
                ),
            ) => pattern.message_type_details().user_header.type_name().to_string(),
            _ => "another type".into(),
        }
    }

    fn inside(&self) -> MutexGuard<'_, Inside<S>> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Patience {
    fn retry<T, E>(
        self,
        attempt: impl FnMut() -> Result<T, E>,
        worth_it: impl Fn(&E) -> bool,
    ) -> Result<T, E> {
        let begin = Instant::now();
        self.retry_by(|| begin.elapsed(), std::thread::sleep, attempt, worth_it)
    }

    /// As [`Patience::retry`], by a clock that tells the time since the beginning.
    fn retry_by<T, E>(
        self,
        elapsed: impl Fn() -> Duration,
        pause: impl Fn(Duration),
        mut attempt: impl FnMut() -> Result<T, E>,
        worth_it: impl Fn(&E) -> bool,
    ) -> Result<T, E> {
        let again = || self == Patience::Bounded && elapsed() + PAUSE < LONGEST;
        loop {
            match attempt() {
                Err(e) if again() && worth_it(&e) => pause(PAUSE),
                answer => return answer,
            }
        }
    }
}

/// Buffer of an ordinary subscriber, messages.
pub(super) fn ordinary_depth(channel: Channel) -> usize {
    match channel {
        Channel::Latest => 1,
        Channel::Stream => super::STREAM_DEPTH,
    }
}

/// Samples that a subscriber may hold at once.
pub(super) fn max_held(channel: Channel) -> usize {
    ordinary_depth(channel) + 2
}

/// Messages that a late subscriber is given.
pub(super) fn history(channel: Channel) -> usize {
    match channel {
        Channel::Latest => 1,
        Channel::Stream => 0,
    }
}

/// The longest list that the topic's creator made room for, bytes.
pub(super) fn list_bytes<S: Service>(topic: &Topic<S>) -> usize {
    attribute(topic, LIST_BYTES).and_then(|bytes| bytes.parse().ok()).unwrap_or(0)
}

/// Whether publishing on the topic is to ring its bell.
pub(super) fn rings<S: Service>(topic: &Topic<S>) -> bool {
    attribute(topic, RINGS).is_some_and(|rings| rings == "true")
}

fn attribute<S: Service>(topic: &Topic<S>, key: &str) -> Option<String> {
    let key = AttributeKey::try_from(key).ok()?;
    topic.attributes().key_value(&key, 0).map(ToString::to_string)
}

fn service_name(topic: &str) -> Result<ServiceName, BusError> {
    let bad = |e| BusError::BadName { what: "topic", name: topic.into(), problem: format!("{e:?}") };
    ServiceName::new(topic).map_err(bad)
}

fn settings(root: &str, prefix: &str) -> Result<Config, iceoryx2::prelude::SemanticStringError> {
    let mut config = Config::default();
    config.global.prefix = FileName::new(prefix.as_bytes())?;
    config.global.set_root_path(&Path::new(root.as_bytes())?);
    config.global.creation_timeout = Duration::from_millis(200);
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

/// The uniform wire form: the message's header as user header, its items as bytes.
fn builder<S: Service>(
    node: &Node<S>,
    topic: &str,
    message: &MessageType,
) -> Result<Builder<[u8], CustomHeaderMarker, S>, BusError> {
    let bad = |e: &dyn std::fmt::Debug| BusError::BadName {
        what: "topic",
        name: topic.into(),
        problem: format!("{e:?}"),
    };
    let name = service_name(topic)?;
    let header = TypeDetail::__internal_new_from_parts(
        TypeVariant::FixedSize,
        message.name,
        message.header_size,
        message.header_align,
    );
    let header = header.map_err(|e| bad(&e))?;
    let builder = node.service_builder(&name).publish_subscribe::<[u8]>().user_header::<CustomHeaderMarker>();
    #[allow(
        unsafe_code,
        reason = "the type is known only as its description; ports copy exactly `header_size` bytes"
    )]
    let builder = unsafe { builder.__internal_set_user_header_type_details(&header) };
    Ok(builder.payload_alignment(Alignment::ALIGN_8))
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn patience_begins_no_attempt_after_half_a_second_however_slow_one_is() {
        let tried = |patience: Patience, attempt_ms| {
            let (clock, attempts) = (Cell::new(Duration::ZERO), Cell::new(0));
            let pass = |time| clock.set(clock.get() + time);
            let attempt = || {
                attempts.set(attempts.get() + 1);
                pass(Duration::from_millis(attempt_ms));
                Err::<(), ()>(())
            };
            assert!(patience.retry_by(|| clock.get(), pass, attempt, |()| true).is_err());
            (attempts.get(), clock.get().as_millis())
        };
        assert_eq!(tried(Patience::Bounded, 200), (3, 650));
        assert_eq!(tried(Patience::Bounded, 600), (1, 600));
        assert_eq!(tried(Patience::Bounded, 0), (20, 475));
        assert_eq!(tried(Patience::None, 0), (1, 0));
        assert_eq!(Patience::Bounded.retry(|| Err::<(), u32>(7), |_| false), Err(7));
    }
}
