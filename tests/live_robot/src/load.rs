//! Work beside a robot: threads that keep processors busy.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use rustix::time::{ClockId, clock_gettime};
use yamabico_host::Scheduling;

/// Threads that keep processors busy, until it is dropped.
pub struct Load(Arc<AtomicBool>);

impl Load {
    /// Starts that many busy loops.
    ///
    /// # Panics
    /// If the system refuses the scheduling.
    pub fn start(threads: usize, scheduling: Scheduling) -> Load {
        let over = Arc::new(AtomicBool::new(false));
        for _ in 0..threads {
            let over = Arc::clone(&over);
            std::thread::spawn(move || {
                assert_eq!(scheduling.apply(), [], "scheduling of the load");
                while !over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        Load(over)
    }
}

/// A thread that always computes, to see what part of a processor a thread gets on this machine.
pub struct Probe {
    over: Arc<AtomicBool>,
    begun: Instant,
    computed_ns: Arc<AtomicU64>,
}

impl Probe {
    /// Starts the thread.
    pub fn start() -> Probe {
        let (over, computed_ns) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let (is_over, computed) = (Arc::clone(&over), Arc::clone(&computed_ns));
        std::thread::spawn(move || {
            while !is_over.load(Ordering::Relaxed) {
                let time = clock_gettime(ClockId::ThreadCPUTime);
                let ns = 1_000_000_000 * time.tv_sec.unsigned_abs() + time.tv_nsec.unsigned_abs();
                computed.store(ns, Ordering::Relaxed);
            }
        });
        Probe { over, begun: Instant::now(), computed_ns }
    }

    /// Stops the thread; returns the share of a processor that it got, 0 to 1.
    pub fn stop(self) -> f64 {
        self.over.store(true, Ordering::Relaxed);
        let computed_s = self.computed_ns.load(Ordering::Relaxed) as f64 * 1e-9;
        (computed_s / self.begun.elapsed().as_secs_f64()).clamp(0.0, 1.0)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
