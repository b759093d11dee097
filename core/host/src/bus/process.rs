//! What is asked of the system for a process or a thread, beyond what safe libraries offer.

/// Keeps every file that is open now, the terminal's three aside, from programs that are started from now on: the transport
/// opens its sockets and files without saying so itself.
pub fn keep_files_from_children() {
    #[allow(unsafe_code, reason = "marks descriptors only; what they refer to stays as it is")]
    unsafe {
        libc::syscall(libc::SYS_close_range, 3_u32, u32::MAX, libc::CLOSE_RANGE_CLOEXEC);
    }
}

/// Gives the calling thread, and those that it starts, SCHED_FIFO with `priority`, 1 to 99.
///
/// # Errors
/// What the system said.
pub fn run_first_come_first_served(priority: u8) -> std::io::Result<()> {
    let parameters = libc::sched_param { sched_priority: i32::from(priority) };
    #[allow(unsafe_code, reason = "the parameters live through the call, and only this thread is concerned")]
    match unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) } {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error()),
    }
}
