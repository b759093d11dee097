//! Counts what code asks of the heap.
//!
//! ```ignore
//! #[global_allocator]
//! static HEAP: CountingAllocator = CountingAllocator;
//!
//! let (proposal, asked) = allocations(|| bench.propose());
//! assert_eq!(asked.calls, 0);
//! ```

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator, which counts for each thread. A test makes it its `#[global_allocator]`.
pub struct CountingAllocator;

/// What one thread asked of the heap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Allocations {
    /// How often memory was asked for, or to be made larger or smaller.
    pub calls: u64,
    /// Bytes taken and not given back; negative where more was given back.
    pub bytes_kept: i64,
}

thread_local! {
    static ASKED: Cell<Allocations> = const { Cell::new(Allocations { calls: 0, bytes_kept: 0 }) };
}

/// Runs `work` and counts what this thread asks of the heap meanwhile.
///
/// # Panics
/// [`CountingAllocator`] is not the test's allocator: nothing would ever be counted.
pub fn allocations<R>(work: impl FnOnce() -> R) -> (R, Allocations) {
    let before = ASKED.get();
    drop(std::hint::black_box(Box::new(0_u8)));
    let start = ASKED.get();
    assert_ne!(before, start, "make `CountingAllocator` the `#[global_allocator]` of this test");
    let result = work();
    let end = ASKED.get();
    let asked = Allocations { calls: end.calls - start.calls, bytes_kept: end.bytes_kept - start.bytes_kept };
    (result, asked)
}

/// Runs what belongs to the bench and not to the code that it tests.
pub(super) fn uncounted<R>(work: impl FnOnce() -> R) -> R {
    let before = ASKED.get();
    let result = work();
    ASKED.set(before);
    result
}

fn count(calls: u64, bytes: i64) {
    // A thread that ends frees its memory when its counters are gone.
    let _ = ASKED.try_with(|asked| {
        let Allocations { calls: before, bytes_kept } = asked.get();
        asked.set(Allocations { calls: before + calls, bytes_kept: bytes_kept + bytes });
    });
}

#[allow(unsafe_code, reason = "hands every call on to the system's allocator")]
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(1, layout.size() as i64);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(1, layout.size() as i64);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(0, -(layout.size() as i64));
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(1, size as i64 - layout.size() as i64);
        unsafe { System.realloc(pointer, layout, size) }
    }
}
