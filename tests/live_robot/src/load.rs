//! Work beside a robot: threads that keep processors busy.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

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

impl Drop for Load {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
