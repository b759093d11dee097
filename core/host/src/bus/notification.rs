//! Waiting for messages without polling.

use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier as IoxNotifier;
use iceoryx2::prelude::{FileDescriptorBased, Service};

use super::node::Node;
use super::service::{Either, IpcService, LocalService, either, map_either};
use super::{Bus, BusError};

/// Notification of the wait sets that listen to a topic; fixed when the topic is created.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Notification {
    /// Publishing wakes no wait set: lockstep, where nothing waits.
    #[default]
    Off,
    /// Publishing wakes every wait set of the topic, at the cost of two system calls for each.
    On,
}

/// Waits for messages on several topics at once. May move to another thread, but is used by one at a time.
pub struct WaitSet {
    listeners: Vec<AnyListener>,
    polled: Vec<libc::pollfd>,
    // Dropped after the listeners, so that the node goes last.
    _bus: Bus,
}

/// Set of topics of a [`WaitSet`] on which something was published.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Notified(u64);

type AnyListener = Either<Box<Listener<LocalService>>, Box<Listener<IpcService>>>;

/// Wakes the wait sets of one topic.
pub(super) struct Notifier(AnyNotifier);

type AnyNotifier = Either<Box<IoxNotifier<LocalService>>, Box<IoxNotifier<IpcService>>>;

#[allow(
    unsafe_code,
    reason = "each listener counts references to itself only, without a lock, and hands none out; not Sync"
)]
unsafe impl Send for WaitSet {}

/// Maximum number of topics in one [`WaitSet`].
pub const MAX_WAIT_TOPICS: usize = u64::BITS as usize;

impl WaitSet {
    pub(super) fn open(bus: &Bus, topics: &[&str]) -> Result<WaitSet, BusError> {
        if topics.len() > MAX_WAIT_TOPICS {
            return Err(BusError::TooManyTopics { max: MAX_WAIT_TOPICS, requested: topics.len() });
        }
        let mut set = WaitSet { listeners: Vec::new(), polled: Vec::new(), _bus: bus.clone() };
        for topic in topics {
            let listener: AnyListener = map_either!(&bus.0.node, node => Box::new(listener(node, topic)?));
            let fd = either!(&listener, listener => descriptor(listener.as_ref()));
            set.listeners.push(listener);
            set.polled.push(libc::pollfd { fd, events: libc::POLLIN, revents: 0 });
        }
        Ok(set)
    }

    /// Sleeps until something is published on one of the topics, for at most `timeout`. Returns the topics that were
    /// published on since the last call; none after a timeout or a signal.
    ///
    /// Several messages may be notified once, and a message may be notified before the call: receive until nothing is
    /// left.
    ///
    /// # Errors
    /// The transport failed.
    pub fn wait(&mut self, timeout: Duration) -> Result<Notified, BusError> {
        let failed = |reason: &dyn std::fmt::Debug| BusError::transport("wait for", "messages", reason);
        let timeout = libc::timespec {
            tv_sec: timeout.as_secs().min(1 << 30) as libc::time_t,
            tv_nsec: libc::c_long::from(timeout.subsec_nanos()),
        };
        #[allow(
            unsafe_code,
            reason = "the array and the time live through the call, and the length is that of the array"
        )]
        let ready = unsafe {
            libc::ppoll(
                self.polled.as_mut_ptr(),
                self.polled.len() as libc::nfds_t,
                &timeout,
                std::ptr::null(),
            )
        };
        if ready < 0 {
            let error = std::io::Error::last_os_error();
            return if error.kind() == std::io::ErrorKind::Interrupted {
                Ok(Notified(0))
            } else {
                Err(failed(&error))
            };
        }
        let mut notified = 0;
        for (i, (listener, polled)) in self.listeners.iter().zip(&self.polled).enumerate() {
            if polled.revents != 0 {
                // A listener that is not drained would end every later wait at once.
                either!(listener, listener => listener.try_wait(|_| {})).map_err(|e| failed(&e))?;
                notified |= 1 << i;
            }
        }
        Ok(Notified(notified))
    }
}

impl Notified {
    /// Returns true if something was published on the topic at `index` in the list that the wait set was opened with.
    pub fn contains(self, index: usize) -> bool {
        index < MAX_WAIT_TOPICS && self.0 & (1 << index) != 0
    }

    /// Returns true if nothing was published.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl Notifier {
    pub(super) fn open(bus: &Bus, topic: &str) -> Result<Notifier, BusError> {
        Ok(Notifier(map_either!(&bus.0.node, node => Box::new(notifier(node, topic)?))))
    }

    pub(super) fn notify(&self) {
        // It fails for a listener whose queue is full or whose process died; neither needs another notification.
        let _ = either!(&self.0, notifier => notifier.notify());
    }
}

fn notifier<S: Service>(node: &Node<S>, topic: &str) -> Result<IoxNotifier<S>, BusError> {
    node.with_event(topic, |event| {
        event.notifier_builder().create().map_err(|e| BusError::transport("notify subscribers of", topic, e))
    })
}

fn listener<S: Service>(node: &Node<S>, topic: &str) -> Result<Listener<S>, BusError> {
    node.with_event(topic, |event| {
        event.listener_builder().create().map_err(|e| BusError::transport("wait for", topic, e))
    })
}

fn descriptor(listener: &impl FileDescriptorBased) -> libc::c_int {
    #[allow(unsafe_code, reason = "the descriptor is only polled, while its listener lives beside it")]
    unsafe {
        listener.file_descriptor().native_handle()
    }
}
