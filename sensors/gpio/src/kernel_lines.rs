//! Lines of the kernel's GPIO character devices, such as `/dev/gpiochip0`.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use gpiocdev::line::{Bias, EdgeDetection, EventClock, Offset, Value};
use gpiocdev::{Chip, Request};
use yamabico_core::device_file;
use yamabico_core::time::Time;

use crate::config::Wiring;
use crate::echo::Edge;
use crate::ring::Lines;

/// Minimum length of a trigger pulse; sonars want 10 us.
const TRIGGER: Duration = Duration::from_micros(15);
/// Number of edges that the kernel keeps; noise may make many.
const KERNEL_BUFFER: u32 = 512;
/// Maximum number of edges read at once, so that noise cannot hold the thread.
const MAX_READ: usize = 4096;

/// Requested lines of a ring of sonars.
pub struct KernelLines {
    request: Request,
    wiring: Vec<Wiring>,
    /// Edges that were read, by their line.
    edges: BTreeMap<Offset, Vec<Edge>>,
}

impl KernelLines {
    /// Requests the lines of `wiring` at the device file `chip`.
    ///
    /// # Errors
    /// The chip or a line is not there, in use, or not accessible; with the remedy.
    pub fn open(chip: &Path, wiring: &[Wiring]) -> Result<KernelLines, String> {
        let name = chip.display();
        // The error of the operating system names the group.
        File::open(chip).map_err(|error| device_file::refusal(chip, &error))?;
        let device = Chip::from_path(chip).map_err(|error| format!("{name} is no GPIO chip: {error}"))?;
        let info = device.info().map_err(|error| format!("{name}: {error}"))?;
        for offset in wiring.iter().flat_map(|wiring| [wiring.trigger, wiring.echo]) {
            if offset >= info.num_lines {
                return Err(format!(
                    "{name} (`{}`) has the lines 0 to {}, and no line {offset}: `gpioinfo` lists chips and lines",
                    info.label,
                    info.num_lines.saturating_sub(1)
                ));
            }
            let line =
                device.line_info(offset).map_err(|error| format!("line {offset} of {name}: {error}"))?;
            if line.used {
                return Err(format!(
                    "line {offset} of {name} is in use by `{}`: end that program, switch off that function, or use another line",
                    line.consumer
                ));
            }
        }
        let triggers: Vec<Offset> = wiring.iter().map(|wiring| wiring.trigger).collect();
        let echoes: Vec<Offset> = wiring.iter().map(|wiring| wiring.echo).collect();
        let request = Request::builder()
            .on_chip(chip)
            .with_consumer("yamabico")
            .with_kernel_event_buffer_size(KERNEL_BUFFER)
            .with_lines(&triggers)
            .as_output(Value::Inactive)
            .with_lines(&echoes)
            .as_input()
            // A line that is not connected reads low.
            .with_bias(Bias::PullDown)
            .with_edge_detection(EdgeDetection::BothEdges)
            .with_event_clock(EventClock::Monotonic)
            .request()
            .map_err(|error| format!("the lines of {name} are refused: {error}"))?;
        Ok(KernelLines { request, wiring: wiring.to_vec(), edges: BTreeMap::new() })
    }

    fn wiring(&self, sonar: usize) -> io::Result<Wiring> {
        self.wiring.get(sonar).copied().ok_or_else(|| io::Error::from(io::ErrorKind::NotFound))
    }
}

impl Lines for KernelLines {
    fn now(&self) -> Time {
        Time::monotonic_now()
    }

    fn wait_until(&mut self, time: Time) {
        sleep(time.since(self.now()));
    }

    fn fire(&mut self, sonar: usize) -> io::Result<(Time, Time)> {
        let trigger = self.wiring(sonar)?.trigger;
        let begun = self.now();
        self.request.set_value(trigger, Value::Active).map_err(io::Error::other)?;
        sleep(TRIGGER);
        self.request.set_value(trigger, Value::Inactive).map_err(io::Error::other)?;
        Ok((begun, self.now()))
    }

    fn edges(&mut self, sonar: usize, edges: &mut Vec<Edge>) -> io::Result<()> {
        let mut count = 0;
        while count < MAX_READ && self.request.has_edge_event().map_err(io::Error::other)? {
            let event = self.request.read_edge_event().map_err(io::Error::other)?;
            let edge = Edge { at: Time(event.timestamp_ns), number: event.line_seqno };
            let waiting = self.edges.entry(event.offset).or_default();
            if waiting.len() < MAX_READ {
                waiting.push(edge);
            }
            count += 1;
        }
        if let Some(waiting) = self.edges.get_mut(&self.wiring(sonar)?.echo) {
            edges.append(waiting);
        }
        Ok(())
    }

    fn is_high(&mut self, sonar: usize) -> io::Result<bool> {
        let echo = self.wiring(sonar)?.echo;
        Ok(self.request.value(echo).map_err(io::Error::other)? == Value::Active)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_chip_is_refused_with_the_remedy() {
        let wiring = [Wiring { trigger: 23, echo: 24 }];
        let refusal = |chip: &str| KernelLines::open(Path::new(chip), &wiring).err().unwrap();
        assert!(refusal("/dev/null").contains("/dev/null is no GPIO chip"), "{}", refusal("/dev/null"));
        let missing = refusal("/dev/gpiochip999");
        assert!(missing.contains("/dev/gpiochip999 does not exist"), "{missing}");
    }
}
