//! A thread that unlinks what killed processes left unfinished, so that nobody waits for it for ever.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use yamabico_host::SeatError;
use yamabico_host::bus::Bus;

/// How often it looks.
const ROUND: Duration = Duration::from_millis(50);

/// The janitor's thread; ends with this.
pub(super) struct JanitorThread {
    over: Arc<AtomicBool>,
}

impl JanitorThread {
    /// Starts on the supervisor's bus.
    pub fn start(bus: &Bus) -> Result<JanitorThread, SeatError> {
        let janitor = bus.janitor()?;
        let over = Arc::new(AtomicBool::new(false));
        let is_over = Arc::clone(&over);
        let rounds = move || {
            while !is_over.load(Ordering::Relaxed) {
                let unlinked = janitor.unlink_unfinished();
                if unlinked > 0 {
                    tracing::info!("unlinked {unlinked} segments that killed processes left unfinished");
                }
                std::thread::sleep(ROUND);
            }
        };
        let started = std::thread::Builder::new().name("janitor".into()).spawn(rounds);
        started.map_err(|source| SeatError::Thread { name: "janitor".into(), source })?;
        Ok(JanitorThread { over })
    }
}

impl Drop for JanitorThread {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}
