//! Waking up when something was published, instead of looking again and again.

use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{FileDescriptorBased as _, Service, ipc, local};

use super::world::World;
use super::{Bus, BusError, Kind};

/// Whether publishing on a topic wakes those who wait for it; fixed when the topic is created.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bell {
    /// It does not: lockstep, where nobody waits.
    #[default]
    Silent,
    /// It does, at the cost of two system calls a waiter.
    Rings,
}

/// Waits for messages on several topics at once. Belongs to one thread at a time.
pub struct Waiter {
    listeners: Vec<AnyListener>,
    polled: Vec<libc::pollfd>,
    // Behind the listeners, so that the world goes last.
    _bus: Bus,
}

/// Which topics of a [`Waiter`] rang.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rang(u64);

enum AnyListener {
    Local(Box<Listener<local::Service>>),
    Ipc(Box<Listener<ipc::Service>>),
}

/// Rings the bell of one topic.
pub(super) enum Ringer {
    Local(Box<Notifier<local::Service>>),
    Ipc(Box<Notifier<ipc::Service>>),
}

#[allow(
    unsafe_code,
    reason = "each listener counts references to itself only, without a lock, and hands none out; not Sync"
)]
unsafe impl Send for Waiter {}

const MOST: usize = u64::BITS as usize;

impl Waiter {
    pub(super) fn open(bus: &Bus, topics: &[&str]) -> Result<Waiter, BusError> {
        if topics.len() > MOST {
            return Err(BusError::TooManyBells { most: MOST, asked: topics.len() });
        }
        let mut waiter = Waiter { listeners: Vec::new(), polled: Vec::new(), _bus: bus.clone() };
        for topic in topics {
            let (listener, fd) = match &bus.0.kind {
                Kind::Local(world) => {
                    let listener = listener(world, topic)?;
                    #[allow(
                        unsafe_code,
                        reason = "the descriptor is only polled, while its listener lives beside it"
                    )]
                    let fd = unsafe { listener.file_descriptor().native_handle() };
                    (AnyListener::Local(Box::new(listener)), fd)
                }
                Kind::Ipc(world) => {
                    let listener = listener(world, topic)?;
                    #[allow(
                        unsafe_code,
                        reason = "the descriptor is only polled, while its listener lives beside it"
                    )]
                    let fd = unsafe { listener.file_descriptor().native_handle() };
                    (AnyListener::Ipc(Box::new(listener)), fd)
                }
            };
            waiter.listeners.push(listener);
            waiter.polled.push(libc::pollfd { fd, events: libc::POLLIN, revents: 0 });
        }
        Ok(waiter)
    }

    /// Sleeps until one of the topics rings, or for `timeout`. Tells which rang since the last call, as indices into the
    /// list that the waiter was opened with; none where the time passed or a signal came.
    ///
    /// A message may ring before the call, and several messages ring once: receive until there is nothing left.
    ///
    /// # Errors
    /// The transport failed.
    pub fn wait(&mut self, timeout: Duration) -> Result<Rang, BusError> {
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
                Ok(Rang(0))
            } else {
                Err(failed(&error))
            };
        }
        let mut rang = 0;
        for (i, (listener, polled)) in self.listeners.iter().zip(&self.polled).enumerate() {
            if polled.revents != 0 {
                match listener {
                    AnyListener::Local(listener) => listener.try_wait(|_| {}),
                    AnyListener::Ipc(listener) => listener.try_wait(|_| {}),
                }
                .map_err(|e| failed(&e))?;
                rang |= 1 << i;
            }
        }
        Ok(Rang(rang))
    }
}

impl Rang {
    /// Whether the topic at this index rang.
    pub fn contains(self, index: usize) -> bool {
        index < MOST && self.0 & (1 << index) != 0
    }

    /// Whether none rang.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl Ringer {
    pub(super) fn ring(&self) {
        // A bell that is full or whose owner died needs no ring: the message has been delivered.
        let _ = match self {
            Ringer::Local(notifier) => notifier.notify(),
            Ringer::Ipc(notifier) => notifier.notify(),
        };
    }
}

pub(super) fn ringer<S: Service>(world: &World<S>, topic: &str) -> Result<Notifier<S>, BusError> {
    world.with_bell(topic, |bell| {
        bell.notifier_builder().create().map_err(|e| BusError::transport("ring on", topic, e))
    })
}

fn listener<S: Service>(world: &World<S>, topic: &str) -> Result<Listener<S>, BusError> {
    world.with_bell(topic, |bell| {
        bell.listener_builder().create().map_err(|e| BusError::transport("wait for", topic, e))
    })
}
