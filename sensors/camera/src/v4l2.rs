//! Cameras of the kernel (Video4Linux 2), such as USB cameras.

use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use moq_v4l::buffer::{Flags, Type};
use moq_v4l::control::{Control, Type as ControlType, Value};
use moq_v4l::frameinterval::FrameIntervalEnum;
use moq_v4l::framesize::FrameSizeEnum;
use moq_v4l::io::mmap::Stream as Buffers;
use moq_v4l::io::traits::CaptureStream;
use moq_v4l::video::Capture;
use moq_v4l::video::capture::Parameters;
use moq_v4l::{Device, Format, FourCC, Fraction};
use yamabico_core::device_file;
use yamabico_core::time::Time;

use crate::grabber::{Image, Source, Stream};
use crate::live_config::live_camera;
use crate::pixels::Pixels;

/// Number of buffers that the kernel fills.
const BUFFERS: u32 = 4;
/// Event of a poll: an image is ready.
const READABLE: i16 = 1;

live_camera! {
    /// Parameters of a camera of the kernel.
    pub struct V4l2CameraConfig {
        /// Device file; the names in `/dev/v4l/by-id` stay the same when cameras are connected in another order.
        #[schemars(extend("format" = "path", "examples" = ["/dev/video0"]))]
        pub device: PathBuf,
        /// Silence after which the camera is opened again.
        #[serde_inline_default(2000.0)]
        #[schemars(range(min = 100.0, max = 60000.0))]
        pub timeout_ms: f64,
        /// Controls of the camera and their values, such as `{ auto_exposure = 1, exposure_time_absolute = 100 }`; an unknown
        /// one is refused with the list of those that the camera has.
        #[serde(default)]
        pub controls: BTreeMap<String, i64>,
    }
}

/// A camera of the kernel.
pub(crate) struct V4l2Source {
    device: PathBuf,
    size: [u32; 2],
    rate_hz: f64,
    timeout_ms: i32,
    controls: BTreeMap<String, i64>,
}

/// A format that a camera offers at one size.
#[derive(Clone, Debug, PartialEq)]
struct Offer {
    fourcc: [u8; 4],
    size: [u32; 2],
    /// Rates, Hz.
    rates: Vec<f64>,
}

impl V4l2Source {
    pub fn new(config: &V4l2CameraConfig) -> V4l2Source {
        V4l2Source {
            device: config.device.clone(),
            size: config.description().size(),
            rate_hz: config.rate_hz,
            timeout_ms: config.timeout_ms as i32,
            controls: config.controls.clone(),
        }
    }
}

impl Source for V4l2Source {
    fn name(&self) -> String {
        self.device.display().to_string()
    }

    fn open(&mut self) -> io::Result<Box<dyn Stream>> {
        let refused = |error: io::Error| io::Error::other(device_file::refusal(&self.device, &error));
        let device = Device::with_path(&self.device).map_err(refused)?;
        let offers = offers(&device, self.size)?;
        let offer = choose(&offers, self.size, self.rate_hz).map_err(io::Error::other)?;
        let [width, height] = self.size;
        let format = device.set_format(&Format::new(width, height, FourCC::new(&offer.fourcc)))?;
        if [format.width, format.height] != self.size || format.fourcc.repr != offer.fourcc {
            return Err(io::Error::other(format!(
                "the camera sets {}x{} instead",
                format.width, format.height
            )));
        }
        // A camera without rates has one of its own.
        let wanted = Parameters::new(Fraction::new(1000, (1000.0 * self.rate_hz) as u32));
        let set_hz = device.set_params(&wanted).map_or(self.rate_hz, |set| rate_hz(&set.interval));
        if set_hz < 0.95 * self.rate_hz {
            tracing::warn!(
                "{} sends {set_hz:.1} images per second at this size, fewer than `rate_hz`: set that to it, or take a smaller size",
                self.name()
            );
        }
        let pixels = match &offer.fourcc {
            b"YUYV" => Pixels::Yuyv(format.stride as usize),
            b"MJPG" | b"JPEG" => Pixels::Jpeg,
            _ => Pixels::Luma(format.stride as usize),
        };
        set_controls(&device, &self.controls)?;
        let buffers = Buffers::with_buffers(&device, Type::VideoCapture, BUFFERS)?;
        let (timeout_ms, first) = (self.timeout_ms, None);
        Ok(Box::new(V4l2Stream { buffers, pixels, timeout_ms, is_started: false, first }))
    }
}

/// Sets controls by their names in lowercase with `_`, in the order of the camera: a mode comes before the value that it frees.
fn set_controls(device: &Device, wanted: &BTreeMap<String, i64>) -> io::Result<()> {
    if wanted.is_empty() {
        return Ok(());
    }
    let key = |name: &str| name.to_lowercase().replace([' ', ',', '-'], "_").replace("__", "_");
    let known = device.query_controls()?;
    if let Some(unknown) = wanted.keys().find(|name| known.iter().all(|control| key(&control.name) != **name))
    {
        let names: Vec<String> = known.iter().map(|control| key(&control.name)).collect();
        return Err(io::Error::other(format!(
            "the camera has no control `{unknown}`; it has {}",
            names.join(", ")
        )));
    }
    for control in &known {
        let Some(value) = wanted.get(&key(&control.name)).copied() else { continue };
        let value = if control.typ == ControlType::Boolean {
            Value::Boolean(value != 0)
        } else {
            Value::Integer(value)
        };
        let refusal = format!(
            "the camera refuses `{}` (range {} to {})",
            key(&control.name),
            control.minimum,
            control.maximum
        );
        device
            .set_control(Control { id: control.id, value })
            .map_err(|error| io::Error::other(format!("{refusal}: {error}")))?;
    }
    Ok(())
}

/// Four characters of the format with luma alone.
const LUMA: [u8; 4] = [b'G', b'R', b'E', b'Y'];

/// Lists the usable formats of a camera. Of a range of sizes these are its ends, and `wanted` if it lies between them.
fn offers(device: &Device, wanted: [u32; 2]) -> io::Result<Vec<Offer>> {
    let (mut offers, mut others) = (Vec::new(), Vec::new());
    for format in device.enum_formats()? {
        let fourcc = format.fourcc;
        if ![*b"YUYV", LUMA, *b"MJPG", *b"JPEG"].contains(&fourcc.repr) {
            others.push(fourcc.to_string());
            continue;
        }
        for size in device.enum_framesizes(fourcc)? {
            let sizes = match size.size {
                FrameSizeEnum::Discrete(size) => vec![[size.width, size.height]],
                FrameSizeEnum::Stepwise(range) => {
                    let ends = [[range.min_width, range.min_height], [range.max_width, range.max_height]];
                    sizes_of_range(ends, [range.step_width, range.step_height], wanted)
                }
            };
            for size in sizes {
                let intervals = device.enum_frameintervals(fourcc, size[0], size[1]).unwrap_or_default();
                let rates = intervals.iter().flat_map(|interval| match &interval.interval {
                    FrameIntervalEnum::Discrete(interval) => vec![rate_hz(interval)],
                    FrameIntervalEnum::Stepwise(range) => vec![rate_hz(&range.max), rate_hz(&range.min)],
                });
                offers.push(Offer { fourcc: fourcc.repr, size, rates: rates.collect() });
            }
        }
    }
    if offers.is_empty() {
        let others = if others.is_empty() { "none".to_owned() } else { others.join(", ") };
        return Err(io::Error::other(format!(
            "it offers no luma, YUYV or JPEG (other formats: {others}): a camera may have several device files, try the next \
             (`ls -l /dev/v4l/by-id`), or read it through a program (`kind = \"program\"`)"
        )));
    }
    Ok(offers)
}

/// Returns the ends of a range of sizes, and `wanted` if it is one of them.
fn sizes_of_range(ends: [[u32; 2]; 2], step: [u32; 2], wanted: [u32; 2]) -> Vec<[u32; 2]> {
    let [min, max] = ends;
    let is_offered = (0..2).all(|i| {
        let (wanted, step) = (wanted[i], step[i].max(1));
        (min[i]..=max[i]).contains(&wanted) && (wanted - min[i]).is_multiple_of(step)
    });
    let mut sizes = ends.to_vec();
    if is_offered && !ends.contains(&wanted) {
        sizes.push(wanted);
    }
    sizes
}

fn rate_hz(interval: &Fraction) -> f64 {
    f64::from(interval.denominator) / f64::from(interval.numerator.max(1))
}

/// Chooses the format for a size (width, height) and a rate, Hz: one that is fast enough, and of these luma before YUYV before
/// JPEG; else the fastest.
fn choose(offers: &[Offer], size: [u32; 2], rate_hz: f64) -> Result<&Offer, String> {
    let fastest = |offer: &Offer| offer.rates.iter().copied().fold(0.0, f64::max);
    let preference = |offer: &Offer| match offer.fourcc {
        LUMA => 3,
        [b'Y', ..] => 2,
        _ => 1,
    };
    let of_size = offers.iter().filter(|offer| offer.size == size);
    let best = of_size.max_by(|a, b| {
        let enough = |offer: &Offer| fastest(offer).min(0.95 * rate_hz);
        enough(a).total_cmp(&enough(b)).then(preference(a).cmp(&preference(b)))
    });
    best.ok_or_else(|| {
        let list = offers.iter().map(|offer| {
            let name = String::from_utf8_lossy(&offer.fourcc);
            format!("{}x{} {name} at {:.0} Hz", offer.size[0], offer.size[1], fastest(offer))
        });
        let list = list.collect::<Vec<_>>().join(", ");
        format!(
            "the camera has no {}x{} pixels; it offers {list}: set `intrinsics` to one of them",
            size[0], size[1]
        )
    })
}

/// An open camera. The buffers of the library panic when a driver refuses to stop; the sensor then fails, and its process starts again.
struct V4l2Stream {
    buffers: Buffers<'static>,
    pixels: Pixels,
    timeout_ms: i32,
    is_started: bool,
    /// Number of the first image.
    first: Option<u32>,
}

impl Stream for V4l2Stream {
    fn next(&mut self) -> io::Result<Image> {
        loop {
            // After a timeout within `next` the library queues a buffer twice: wait before it. The first call starts the camera.
            let handle = self.buffers.handle();
            if std::mem::replace(&mut self.is_started, true) {
                match handle.poll(READABLE, self.timeout_ms) {
                    Ok(0) => return Err(io::Error::new(io::ErrorKind::TimedOut, "no image in time")),
                    // A signal.
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                    ready => drop(ready?),
                }
            }
            self.buffers.set_timeout(Duration::from_millis(u64::from(self.timeout_ms.unsigned_abs())));
            let (bytes, meta) = self.buffers.next()?;
            if meta.flags.contains(Flags::ERROR) {
                continue;
            }
            let data = bytes[..bytes.len().min(meta.bytesused as usize)].to_vec();
            let number = u64::from(meta.sequence.wrapping_sub(*self.first.get_or_insert(meta.sequence)));
            let is_monotonic = meta.flags & Flags::TIMESTAMP_MASK == Flags::TIMESTAMP_MONOTONIC;
            let captured = Duration::from(meta.timestamp);
            let stamp = if is_monotonic { Time::ZERO + captured } else { Time::monotonic_now() };
            return Ok(Image { stamp, number, pixels: self.pixels, data });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(fourcc: &[u8; 4], size: [u32; 2], rates: &[f64]) -> Offer {
        Offer { fourcc: *fourcc, size, rates: rates.to_vec() }
    }

    #[test]
    fn the_format_follows_size_and_rate() {
        let offers = [
            offer(b"MJPG", [640, 480], &[30.0, 15.0]),
            offer(b"YUYV", [640, 480], &[30.0]),
            offer(b"YUYV", [1280, 720], &[10.0]),
            offer(b"MJPG", [1280, 720], &[30.0]),
        ];
        let chosen = |size, rate_hz| choose(&offers, size, rate_hz).unwrap().fourcc;
        assert_eq!(chosen([640, 480], 30.0), *b"YUYV");
        assert_eq!(chosen([1280, 720], 30.0), *b"MJPG", "fast enough");
        assert_eq!(chosen([1280, 720], 10.0), *b"YUYV");
        assert_eq!(chosen([640, 480], 90.0), *b"YUYV", "the fastest that there is");
        let none = choose(&offers, [800, 600], 30.0).unwrap_err();
        assert!(none.contains("800x600") && none.contains("1280x720 MJPG at 30 Hz"), "{none}");
    }

    #[test]
    fn a_size_within_a_range_is_offered() {
        let ends = [[32, 32], [2592, 1944]];
        assert_eq!(sizes_of_range(ends, [2, 2], [640, 480]), [ends[0], ends[1], [640, 480]]);
        for wanted in [[641, 480], [16, 480], [2594, 1944], [32, 32]] {
            assert_eq!(sizes_of_range(ends, [2, 2], wanted), ends, "{wanted:?}");
        }
        assert_eq!(sizes_of_range(ends, [0, 0], [641, 480]).len(), 3, "a driver without steps");
    }
}
