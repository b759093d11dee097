//! System calls that no safe library offers.

/// Marks every open file but the three of the terminal as close-on-exec, so that programs started from now on do not
/// inherit the transport's sockets and segments, which it opens without that flag.
pub fn close_files_in_children() {
    #[allow(unsafe_code, reason = "sets a flag of the descriptors only; the open files stay as they are")]
    unsafe {
        libc::syscall(libc::SYS_close_range, 3_u32, u32::MAX, libc::CLOSE_RANGE_CLOEXEC);
    }
}

/// Gives the calling thread, and threads that it starts from now on, SCHED_FIFO with `priority`, 1 to 99.
pub(crate) fn set_fifo_priority(priority: u8) -> std::io::Result<()> {
    let parameters = libc::sched_param { sched_priority: i32::from(priority) };
    #[allow(unsafe_code, reason = "the parameters live through the call, which affects this thread only")]
    match unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) } {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error()),
    }
}
