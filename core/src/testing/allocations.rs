//! Counts heap allocations, to test that code does not allocate.
//!
//! ```standalone_crate
//! use yamabico_core::testing::{CountingAllocator, allocations};
//!
//! #[global_allocator]
//! static HEAP: CountingAllocator = CountingAllocator;
//!
//! fn main() {
//!     let (sum, counted) = allocations(|| vec![1, 2, 3].iter().sum::<i32>());
//!     assert_eq!((sum, counted.calls, counted.bytes_kept), (6, 1, 0));
//! }
//! ```

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system allocator with per-thread counters. A test makes it its `#[global_allocator]`.
pub struct CountingAllocator;

/// Heap allocations of one thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Allocations {
    /// Number of allocations and reallocations.
    pub calls: u64,
    /// Bytes allocated and not freed; negative if more were freed.
    pub bytes_kept: i64,
}

thread_local! {
    static COUNTED: Cell<Allocations> = const { Cell::new(Allocations { calls: 0, bytes_kept: 0 }) };
}

/// Runs `work` and returns its result and its heap allocations on this thread.
///
/// # Panics
/// [`CountingAllocator`] is not the global allocator of the test.
pub fn allocations<R>(work: impl FnOnce() -> R) -> (R, Allocations) {
    let before = COUNTED.get();
    drop(std::hint::black_box(Box::new(0_u8)));
    let start = COUNTED.get();
    assert_ne!(before, start, "make `CountingAllocator` the `#[global_allocator]` of this test");
    let result = work();
    let end = COUNTED.get();
    let allocations =
        Allocations { calls: end.calls - start.calls, bytes_kept: end.bytes_kept - start.bytes_kept };
    (result, allocations)
}

/// Runs code of the test bench without counting its allocations.
pub(super) fn uncounted<R>(work: impl FnOnce() -> R) -> R {
    let before = COUNTED.get();
    let result = work();
    COUNTED.set(before);
    result
}

fn count(calls: u64, bytes: i64) {
    // A thread that ends frees memory after its thread-locals are destroyed.
    let _ = COUNTED.try_with(|counted| {
        let Allocations { calls: before, bytes_kept } = counted.get();
        counted.set(Allocations { calls: before + calls, bytes_kept: bytes_kept + bytes });
    });
}

#[allow(unsafe_code, reason = "forwards every call to the system allocator")]
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
