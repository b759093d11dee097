//! What the transport forgets about processes that start others.

/// Keeps every file that is open now, the terminal's three aside, from programs that are started from now on: the transport
/// opens its sockets and files without saying so itself.
pub fn keep_files_from_children() {
    #[allow(unsafe_code, reason = "marks descriptors only; what they refer to stays as it is")]
    unsafe {
        libc::syscall(libc::SYS_close_range, 3_u32, u32::MAX, libc::CLOSE_RANGE_CLOEXEC);
    }
}
