//! Live cameras: a server that cuts off, stalls and sends damaged images, and a program that ends.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use yamabico_camera::driver;
use yamabico_core::behavior::{Outputs, ParameterError};
use yamabico_core::driver::{Device, DeviceSpec, PartSpec};
use yamabico_core::message::FrameHeader;
use yamabico_core::sensor::{DeviceError, Robot, Sensor};
use yamabico_core::testing::Published;
use yamabico_core::time::Time;

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;

/// A JPEG of one gray level.
fn jpeg(level: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    let picture = image::GrayImage::from_pixel(WIDTH, HEIGHT, image::Luma([level]));
    image::codecs::jpeg::JpegEncoder::new(&mut bytes).encode_image(&picture).unwrap();
    bytes
}

fn open(kind: &str, keys: &str) -> Result<Device, ParameterError> {
    let common = format!(
        "latency_ms = 20.0\nintrinsics = {{ width = {WIDTH}, height = {HEIGHT} }}\nmount = {{ z_m = 0.3 }}\n{keys}"
    );
    let part = PartSpec { name: "front".into(), kind: kind.into(), table: toml::from_str(&common).unwrap() };
    driver().describe_sensor(&part, std::path::Path::new("/"))?;
    driver().open(DeviceSpec {
        name: "camera".into(),
        table: toml::Table::new(),
        sensors: vec![part],
        drive: None,
        folder: "/".into(),
        seed: 0,
        robot: Robot::default(),
    })
}

fn sensor(kind: &str, keys: &str) -> Box<dyn Sensor> {
    open(kind, keys).map_err(|error| error.to_string()).unwrap().sensors.remove(0).1
}

/// Polls until `is_done`, for at most `max_s`; returns the frames.
fn watch(
    sensor: &mut dyn Sensor,
    max_s: f64,
    is_done: impl Fn(&[(FrameHeader, Vec<u8>)]) -> bool,
) -> Result<Vec<(FrameHeader, Vec<u8>)>, DeviceError> {
    let (mut published, begin) = (Published::default(), Instant::now());
    loop {
        sensor.poll(Time::monotonic_now(), &mut Outputs::new(&mut published))?;
        let frames = published.of("front");
        if is_done(&frames) {
            return Ok(frames);
        }
        assert!(begin.elapsed().as_secs_f64() < max_s, "only {} frames", frames.len());
        std::thread::sleep(Duration::from_millis(3));
    }
}

/// A server that answers each connection by its number. Returns its port and the count of its connections.
fn server(answer: impl Fn(u32, &mut TcpStream) + Send + 'static) -> (u16, Arc<AtomicU32>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let (port, count) = (listener.local_addr().unwrap().port(), Arc::new(AtomicU32::new(0)));
    let of_thread = Arc::clone(&count);
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let (mut request, mut part) = (Vec::new(), [0; 1024]);
            while !request.ends_with(b"\r\n\r\n") {
                match stream.read(&mut part) {
                    Ok(len @ 1..) => request.extend_from_slice(&part[..len]),
                    _ => break,
                }
            }
            let request = String::from_utf8_lossy(&request).into_owned();
            assert!(request.starts_with("GET /stream?a=1 HTTP/1.0\r\n"), "{request}");
            assert!(request.contains("Authorization: Basic bWU6c2VjcmV0\r\n"), "{request}");
            answer(of_thread.fetch_add(1, Ordering::Relaxed), &mut stream);
        }
    });
    (port, count)
}

fn head(stream: &mut TcpStream) {
    let head = "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=part\r\n\r\n";
    let _ = stream.write_all(head.as_bytes());
}

fn part(stream: &mut TcpStream, image: &[u8]) -> std::io::Result<()> {
    stream.write_all(b"--part\r\nContent-Type: image/jpeg\r\n\r\n")?;
    stream.write_all(image)?;
    stream.write_all(b"\r\n")?;
    std::thread::sleep(Duration::from_millis(10));
    Ok(())
}

#[test]
fn a_stream_over_http_comes_back_from_refusals_cuts_stalls_and_damage() {
    let (port, connections) = server(|number, stream| match number {
        0 => stream.write_all(b"HTTP/1.0 503 Busy\r\n\r\n").unwrap(),
        1 => {
            // Cut off in the middle of the second image.
            head(stream);
            part(stream, &jpeg(50)).unwrap();
            let _ = stream.write_all(&jpeg(50)[..200]);
        }
        2 => {
            // Stalls.
            head(stream);
            part(stream, &jpeg(100)).unwrap();
            std::thread::sleep(Duration::from_millis(1500));
        }
        _ => {
            head(stream);
            let mut damaged = jpeg(150);
            // The size of a table: nothing behind it can be decoded.
            damaged[5] = 1;
            let _ = part(stream, &damaged);
            while part(stream, &jpeg(200)).is_ok() {}
        }
    });
    let keys = format!("url = \"http://me:secret@127.0.0.1:{port}/stream?a=1\"\ntimeout_ms = 500.0");
    let mut camera = sensor("http", &keys);
    let begin = Time::monotonic_now();
    let frames = watch(camera.as_mut(), 20.0, |frames| {
        frames.iter().filter(|(_, pixels)| pixels[9] > 190).count() > 5
    });
    let frames = frames.unwrap();
    // A stalled server accepts late what was given up meanwhile.
    assert!(connections.load(Ordering::Relaxed) >= 4);
    let levels: Vec<u8> = frames.iter().map(|(_, pixels)| pixels[100]).collect();
    let is_near = |level: u8, expected: u8| level.abs_diff(expected) <= 2;
    assert!(is_near(levels[0], 50) && is_near(levels[1], 100) && is_near(levels[2], 200), "{levels:?}");
    for pair in frames.windows(2) {
        assert!(pair[1].0.sequence > pair[0].0.sequence && pair[1].0.stamp_ns > pair[0].0.stamp_ns);
    }
    let (header, pixels) = frames.last().unwrap();
    let age_s = Time::monotonic_now().seconds_after(Time(header.stamp_ns));
    assert!(age_s >= 0.02 && Time(header.stamp_ns) > begin - Duration::from_millis(20), "{age_s}");
    assert_eq!((header.width, header.height, header.stride, pixels.len()), (WIDTH, HEIGHT, WIDTH, 64 * 48));
}

#[test]
fn a_program_that_ends_is_started_again() {
    let file = std::env::temp_dir().join(format!("yamabico-program-{}.jpg", std::process::id()));
    std::fs::write(&file, [jpeg(30), jpeg(60)].concat()).unwrap();
    let command = format!("cat {} && sleep 0.05 && cat {}", file.display(), file.display());
    let mut camera =
        sensor("program", &format!("command = [\"sh\", \"-c\", \"{command}\"]\nencoding = \"rgb8\""));
    let frames =
        watch(camera.as_mut(), 20.0, |frames| frames.last().is_some_and(|(header, _)| header.sequence > 8));
    let frames = frames.unwrap();
    assert!(frames.iter().all(|(header, pixels)| header.stride == 3 * WIDTH && pixels.len() == 3 * 64 * 48));
    assert!(frames.iter().any(|(_, pixels)| pixels[0].abs_diff(60) <= 2));
    let _ = std::fs::remove_file(file);
}

#[test]
fn a_program_that_hangs_is_ended() {
    let mut camera = sensor("program", "command = [\"sh\", \"-c\", \"sleep 100\"]\ntimeout_ms = 100.0");
    // Nothing arrives, and nothing blocks.
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(500) {
        let mut published = Published::default();
        camera.poll(Time::monotonic_now(), &mut Outputs::new(&mut published)).unwrap();
        assert_eq!(published.iter().count(), 0);
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn wrong_sizes_addresses_and_lockstep_are_refused() {
    let file = std::env::temp_dir().join(format!("yamabico-size-{}.jpg", std::process::id()));
    let mut big = Vec::new();
    image::codecs::jpeg::JpegEncoder::new(&mut big).encode_image(&image::GrayImage::new(80, 48)).unwrap();
    std::fs::write(&file, big).unwrap();
    let mut camera = sensor("program", &format!("command = [\"cat\", \"{}\"]", file.display()));
    let refused = watch(camera.as_mut(), 20.0, |_| false).unwrap_err().to_string();
    assert!(refused.contains("80x48") && refused.contains("64x48"), "{refused}");
    let _ = std::fs::remove_file(file);

    let error = open("http", "url = \"https://camera\"").err().unwrap();
    assert!(error.key == "url" && error.problem.contains("ffmpeg"), "{error}");
    assert_eq!(open("program", "command = []").err().unwrap().key, "command");
    let mut published = Published::default();
    let lockstep = camera.poll(Time::ZERO, &mut Outputs::new(&mut published)).unwrap_err();
    assert!(lockstep.to_string().contains("--live"), "{lockstep}");
}
