//! Node of the transport: its topics, and the settings that every process of a robot shares.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node as IoxNode, NodeBuilder};
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

use super::retry::Retry;
use super::service::{Either, IpcService, LocalService};
use super::{BusError, Notification, TopicSpec};
use yamabico_core::message::{Channel, MessageType};

pub(super) type Topic<S> = PortFactory<S, [u8], CustomHeaderMarker>;
pub(super) type AnyNode = Either<Node<LocalService>, Node<IpcService>>;

/// Node of the transport with the topics that it has created or opened.
pub(super) struct Node<S: Service> {
    config: Config,
    retry: Retry,
    inner: Mutex<Inner<S>>,
}

struct Inner<S: Service> {
    topics: HashMap<String, Arc<Topic<S>>>,
    events: HashMap<String, EventFactory<S>>,
    node: IoxNode<S>,
}

/// Maximum number of nodes on a topic, dead ones included.
const MAX_NODES: usize = 64;
/// Attribute of a service: longest list, bytes.
const LIST_BYTES: &str = "yamabico.list_bytes";
/// Attribute of a service: `true` if its publishers notify.
const NOTIFIES: &str = "yamabico.notifies";

impl<S: Service> Node<S> {
    pub(super) fn new(name: &str, root: &str, prefix: &str, retry: Retry) -> Result<Node<S>, BusError> {
        set_log_level_from_env_or(LogLevel::Fatal);
        let config = config(root, prefix).map_err(|reason| BusError::transport("configure", name, reason))?;
        let node = retry.run(
            || {
                NodeBuilder::new()
                    .config(&config)
                    .signal_handling_mode(SignalHandlingMode::Disabled)
                    .create::<S>()
            },
            |_| true,
        );
        let node = node.map_err(|reason| BusError::transport("join", name, reason))?;
        Ok(Node {
            config,
            retry,
            inner: Mutex::new(Inner { topics: HashMap::new(), events: HashMap::new(), node }),
        })
    }

    pub(super) fn create(
        &self,
        topic: &str,
        message: &MessageType,
        spec: &TopicSpec,
    ) -> Result<(), BusError> {
        let failed = |reason: &dyn std::fmt::Debug| BusError::transport("create topic", topic, reason);
        let mut inner = self.inner();
        let notifies = spec.notification == Notification::On;
        let mut limits = AttributeSpecifier::new();
        for (key, value) in [(LIST_BYTES, spec.list_bytes.to_string()), (NOTIFIES, notifies.to_string())] {
            let key = AttributeKey::try_from(key).map_err(|e| failed(&e))?;
            let value = AttributeValue::try_from(value.as_str()).map_err(|e| failed(&e))?;
            limits = limits.define(&key, &value).map_err(|e| failed(&e))?;
        }
        let created = builder(&inner.node, topic, message)?
            .max_publishers(spec.publishers)
            .max_subscribers(spec.subscribers)
            .max_nodes(MAX_NODES)
            .subscriber_max_buffer_size(spec.depth.max(default_depth(message.channel)))
            .subscriber_max_borrowed_samples(max_held(message.channel))
            .history_size(history(message.channel))
            .enable_safe_overflow(true)
            .create_with_attributes(&limits);
        let factory = created.map_err(|e| match e {
            PublishSubscribeCreateError::AlreadyExists => BusError::Exists { topic: topic.into() },
            e => failed(&e),
        })?;
        if notifies {
            let event = inner
                .node
                .service_builder(&service_name(topic)?)
                .event()
                .max_notifiers(spec.publishers)
                .max_listeners(spec.subscribers)
                .max_nodes(MAX_NODES)
                .create()
                .map_err(|e| BusError::transport("create the event service of", topic, e))?;
            inner.events.insert(topic.into(), event);
        }
        inner.topics.insert(topic.into(), Arc::new(factory));
        Ok(())
    }

    /// Removes the resources of dead nodes. Returns the number of nodes cleaned up and of nodes for which that failed.
    /// May block.
    pub(super) fn clean_dead_nodes(&self) -> (u64, u64) {
        let state = self.inner().node.try_cleanup_dead_nodes();
        (state.cleanups, state.failed_cleanups)
    }

    /// Runs `work` on the topic; opens it first if necessary.
    pub(super) fn with_topic<R>(
        &self,
        topic: &str,
        message: &MessageType,
        work: impl FnOnce(&Arc<Topic<S>>) -> Result<R, BusError>,
    ) -> Result<R, BusError> {
        let mut inner = self.inner();
        if !inner.topics.contains_key(topic) {
            let opened = self.open(&inner.node, topic, message)?;
            inner.topics.insert(topic.into(), Arc::new(opened));
        }
        let Some(factory) = inner.topics.get(topic) else {
            return Err(BusError::NoSuchTopic { topic: topic.into() });
        };
        let carries = factory.static_config().message_type_details().user_header.type_name().to_string();
        if carries != message.name {
            return Err(BusError::WrongType { topic: topic.into(), carries, requested: message.name });
        }
        work(factory)
    }

    /// Runs `work` on the event service of the topic; opens it first if necessary.
    pub(super) fn with_event<R>(
        &self,
        topic: &str,
        work: impl FnOnce(&EventFactory<S>) -> Result<R, BusError>,
    ) -> Result<R, BusError> {
        let mut inner = self.inner();
        if !inner.events.contains_key(topic) {
            let name = service_name(topic)?;
            let opened = self.retry.run(|| inner.node.service_builder(&name).event().open(), |_| true);
            let opened = opened.map_err(|e| match e {
                EventOpenError::DoesNotExist => BusError::NoNotification { topic: topic.into() },
                e => BusError::transport("open the event service of", topic, e),
            })?;
            inner.events.insert(topic.into(), opened);
        }
        match inner.events.get(topic) {
            Some(event) => work(event),
            None => Err(BusError::NoNotification { topic: topic.into() }),
        }
    }

    fn open(&self, node: &IoxNode<S>, topic: &str, message: &MessageType) -> Result<Topic<S>, BusError> {
        use PublishSubscribeOpenError as E;
        let builder = builder(node, topic, message)?;
        let is_final = |e: &E| matches!(e, E::IncompatibleTypes | E::InsufficientPermissions);
        self.retry.run(|| builder.clone().open(), |e| !is_final(e)).map_err(|e| match e {
            E::DoesNotExist => BusError::NoSuchTopic { topic: topic.into() },
            E::IncompatibleTypes => BusError::WrongType {
                topic: topic.into(),
                carries: self.message_name(topic),
                requested: message.name,
            },
            e => BusError::transport("open topic", topic, e),
        })
    }

    /// Name of the message type that an existing topic carries.
    fn message_name(&self, topic: &str) -> String {
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

    fn inner(&self) -> MutexGuard<'_, Inner<S>> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Buffer depth of an ordinary subscriber, messages.
pub(super) fn default_depth(channel: Channel) -> usize {
    match channel {
        Channel::Latest => 1,
        Channel::Stream => super::STREAM_DEPTH,
    }
}

/// Maximum number of samples that a subscriber holds at once.
pub(super) fn max_held(channel: Channel) -> usize {
    default_depth(channel) + 2
}

/// Number of earlier messages that a late subscriber receives.
pub(super) fn history(channel: Channel) -> usize {
    match channel {
        Channel::Latest => 1,
        Channel::Stream => 0,
    }
}

/// Longest list that the topic was created for, bytes.
pub(super) fn max_list_bytes<S: Service>(topic: &Topic<S>) -> usize {
    attribute(topic, LIST_BYTES).and_then(|bytes| bytes.parse().ok()).unwrap_or(0)
}

/// Returns true if publishers of the topic notify.
pub(super) fn has_notification<S: Service>(topic: &Topic<S>) -> bool {
    attribute(topic, NOTIFIES).is_some_and(|notifies| notifies == "true")
}

fn attribute<S: Service>(topic: &Topic<S>, key: &str) -> Option<String> {
    let key = AttributeKey::try_from(key).ok()?;
    topic.attributes().key_value(&key, 0).map(ToString::to_string)
}

fn service_name(topic: &str) -> Result<ServiceName, BusError> {
    let bad = |e| BusError::BadName { what: "topic", name: topic.into(), problem: format!("{e:?}") };
    ServiceName::new(topic).map_err(bad)
}

fn config(root: &str, prefix: &str) -> Result<Config, iceoryx2::prelude::SemanticStringError> {
    let mut config = Config::default();
    config.global.prefix = FileName::new(prefix.as_bytes())?;
    config.global.set_root_path(&Path::new(root.as_bytes())?);
    config.global.creation_timeout = Duration::from_millis(200);
    // The supervisor alone cleans up; see `clean_up`.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

/// Service with the uniform wire format: the message's header as user header, its items as bytes.
fn builder<S: Service>(
    node: &IoxNode<S>,
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
        reason = "the type is known only by its description; ports copy exactly `header_size` bytes"
    )]
    let builder = unsafe { builder.__internal_set_user_header_type_details(&header) };
    Ok(builder.payload_alignment(Alignment::ALIGN_8))
}
