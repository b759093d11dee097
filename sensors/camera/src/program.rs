//! Motion JPEG from the output of a program: a Raspberry Pi camera, a video file, RTSP, or anything that ffmpeg or GStreamer reads.

use std::io::{self, Read};
use std::process::{Child, ChildStdout, Command, Stdio};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use yamabico_core::behavior::ParameterError;

use crate::grabber::{Source, Stream};
use crate::jpeg_stream::JpegStream;
use crate::live_config::live_camera;

live_camera! {
    /// Parameters of a camera that a program reads.
    pub struct ProgramCameraConfig {
        /// Program and its arguments; it writes JPEG images to its standard output, one after the other. It is started
        /// again when it ends.
        #[schemars(length(min = 1), extend("examples" = [["rpicam-vid", "-t", "0", "--codec", "mjpeg", "-o", "-"]]))]
        pub command: Vec<String>,
        /// Silence after which the program is ended and started again.
        #[serde_inline_default(5000.0)]
        #[schemars(range(min = 100.0, max = 60000.0))]
        pub timeout_ms: f64,
    }
}

/// Output of a program.
#[derive(Clone, Debug)]
pub(crate) struct ProgramSource {
    command: Vec<String>,
    timeout: Timespec,
}

impl ProgramSource {
    /// Returns the source of these parameters.
    ///
    /// # Errors
    /// An empty command.
    pub fn new(config: &ProgramCameraConfig) -> Result<ProgramSource, ParameterError> {
        if config.command.first().is_none_or(String::is_empty) {
            return Err(ParameterError::new("command", "must name a program"));
        }
        let milliseconds = config.timeout_ms as i64;
        let timeout = Timespec { tv_sec: milliseconds / 1000, tv_nsec: milliseconds % 1000 * 1_000_000 };
        Ok(ProgramSource { command: config.command.clone(), timeout })
    }
}

impl Source for ProgramSource {
    fn name(&self) -> String {
        format!("`{}`", self.command.join(" "))
    }

    fn open(&mut self) -> io::Result<Box<dyn Stream>> {
        let (program, arguments) = self.command.split_first().ok_or(io::ErrorKind::InvalidInput)?;
        let mut command = Command::new(program);
        // Its standard error appears beside that of this process.
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = command.spawn().map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => {
                io::Error::other(format!("there is no program `{program}`: install it"))
            }
            _ => error,
        })?;
        let output = child.stdout.take().ok_or(io::ErrorKind::BrokenPipe)?;
        Ok(Box::new(JpegStream::new(RunningProgram { child, output, timeout: self.timeout })))
    }
}

/// A running program, killed when it is no longer read. If this process is killed, the program ends at its next image: no process
/// reads its output.
struct RunningProgram {
    child: Child,
    output: ChildStdout,
    timeout: Timespec,
}

impl Read for RunningProgram {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut waiting = [PollFd::new(&self.output, PollFlags::IN)];
        if poll(&mut waiting, Some(&self.timeout))? == 0 {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        match self.output.read(bytes)? {
            0 => Err(io::Error::other(format!("it has ended ({})", self.child.wait()?))),
            count => Ok(count),
        }
    }
}

impl Drop for RunningProgram {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
