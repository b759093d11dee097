//! Thread that unlinks the shared memory that killed processes left unfinished, so that no process waits for it forever.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use yamabico_host::HostError;
use yamabico_host::bus::Bus;

/// Period of the thread.
const PERIOD: Duration = Duration::from_millis(50);

/// The janitor's thread; dropping this ends it.
pub(super) struct JanitorThread {
    is_over: Arc<AtomicBool>,
}

impl JanitorThread {
    /// Starts the thread on the supervisor's bus.
    pub fn start(bus: &Bus) -> Result<JanitorThread, HostError> {
        let janitor = bus.janitor()?;
        let is_over = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&is_over);
        let body = move || {
            while !flag.load(Ordering::Relaxed) {
                let unlinked = janitor.unlink_unfinished();
                if unlinked > 0 {
                    tracing::info!(
                        "unlinked {unlinked} shared-memory segments that killed processes left unfinished"
                    );
                }
                std::thread::sleep(PERIOD);
            }
        };
        let started = std::thread::Builder::new().name("janitor".into()).spawn(body);
        started.map_err(|source| HostError::Thread { name: "janitor".into(), source })?;
        Ok(JanitorThread { is_over })
    }
}

impl Drop for JanitorThread {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}
