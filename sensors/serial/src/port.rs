//! Opening of serial ports.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::termios::ioctl_tiocexcl;
use serial2::{SerialPort, Settings};
use yamabico_core::device_file;

/// Longest wait of a read; bounds the time between two turns of a conversation.
const READ_TIMEOUT: Duration = Duration::from_millis(5);
/// Longest wait of a write. A device that does not read by then has missed the bytes.
const WRITE_TIMEOUT: Duration = Duration::from_millis(10);

/// A serial port that cannot be opened.
#[derive(Debug, thiserror::Error)]
#[error("{}", device_file::refusal(path, source))]
pub struct PortError {
    /// Device file.
    pub path: PathBuf,
    /// Error of the operating system.
    pub source: io::Error,
}

/// Opens a serial port for this process alone: `baud` bits per second, 8 data bits, no parity, one stop bit, no flow control.
/// Bytes received before are discarded.
///
/// # Errors
/// [`PortError`], with the remedy.
pub(crate) fn open(path: &Path, baud: u32) -> Result<SerialPort, PortError> {
    try_to_open(path, baud).map_err(|source| PortError { path: path.to_owned(), source })
}

fn try_to_open(path: &Path, baud: u32) -> io::Result<SerialPort> {
    let mut port = SerialPort::open(path, |mut settings: Settings| {
        settings.set_raw();
        settings.set_baud_rate(baud)?;
        Ok(settings)
    })?;
    ioctl_tiocexcl(&port)?;
    port.set_read_timeout(READ_TIMEOUT)?;
    port.set_write_timeout(WRITE_TIMEOUT)?;
    port.discard_buffers()?;
    Ok(port)
}
