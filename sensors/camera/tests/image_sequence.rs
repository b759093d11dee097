//! Image sequences: files become frames, and errors name the file.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::path::{Path, PathBuf};

use yamabico_camera::driver;
use yamabico_core::behavior::{Outputs, ParameterError};
use yamabico_core::driver::{Device, DeviceSpec, PartSpec};
use yamabico_core::message::{Encoding, FrameHeader};
use yamabico_core::sensor::{DeviceError, Due, Robot, Sensor};
use yamabico_core::testing::Published;
use yamabico_core::time::Time;

const WIDTH: u32 = 32;
const HEIGHT: u32 = 24;

/// Temporary folder, deleted at the end of a test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("yamabico-images-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    /// Writes a uniform gray image.
    fn gray(&self, name: &str, level: u8) -> PathBuf {
        let path = self.0.join(name);
        image::GrayImage::from_pixel(WIDTH, HEIGHT, image::Luma([level])).save(&path).unwrap();
        path
    }

    /// Writes an image of noise: half of its file does not contain the whole image.
    fn noise(&self, name: &str) -> PathBuf {
        let path = self.0.join(name);
        let level = |x: u32, y: u32| {
            (x.wrapping_mul(7919) ^ y.wrapping_mul(104_729)).wrapping_mul(2_654_435_761) >> 24
        };
        image::RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
            image::Rgb([level(x, y) as u8, level(y, x + 9) as u8, level(x + 5, y + 3) as u8])
        })
        .save(&path)
        .unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn open(folder: &Path, keys: &str) -> Result<Device, ParameterError> {
    let part = PartSpec {
        name: "front".into(),
        kind: "image-sequence".into(),
        table: toml::from_str(&keys_of(keys)).unwrap(),
    };
    driver().open(spec(folder, part))
}

fn keys_of(keys: &str) -> String {
    format!("intrinsics = {{ width = {WIDTH}, height = {HEIGHT} }}\nmount = {{ z_m = 0.3 }}\n{keys}")
}

fn spec(folder: &Path, part: PartSpec) -> DeviceSpec {
    DeviceSpec {
        name: "camera".into(),
        table: toml::Table::new(),
        sensors: vec![part],
        drive: None,
        folder: folder.to_owned(),
        seed: 0,
        robot: Robot::default(),
    }
}

fn sensor(folder: &Path, keys: &str) -> Box<dyn Sensor> {
    match open(folder, keys) {
        Ok(mut device) => device.sensors.remove(0).1,
        Err(error) => panic!("{error}"),
    }
}

fn refusal(folder: &Path, keys: &str) -> String {
    match open(folder, keys) {
        Ok(_) => panic!("was opened"),
        Err(error) => {
            assert_eq!(error.key, "files");
            let table = toml::from_str(&keys_of(keys)).unwrap();
            let part = PartSpec { name: "front".into(), kind: "image-sequence".into(), table };
            let checked = driver().check_sensor(&part, folder).unwrap_err();
            assert!(error.problem.ends_with(&checked.problem), "{checked} / {error}");
            error.to_string()
        }
    }
}

/// Polls when due, until the sequence ends or `max` frames were published.
fn watch(sensor: &mut dyn Sensor, max: usize) -> Result<Vec<(FrameHeader, Vec<u8>)>, DeviceError> {
    let (mut published, mut now) = (Published::default(), Time::from_secs_f64(5.0));
    while published.iter().count() < max {
        match sensor.poll(now, &mut Outputs::new(&mut published))? {
            Due::At(next) => {
                assert!(next > now, "time must advance");
                now = next;
            }
            Due::Ended => break,
        }
    }
    Ok(published.of("front"))
}

#[test]
fn files_are_published_by_name_at_the_rate_until_the_end() {
    let folder = Folder::new("order");
    for (name, level) in [("b.png", 20), ("a.jpg", 10), ("c.PNG", 30)] {
        folder.gray(name, level);
    }
    std::fs::write(folder.0.join("README.md"), "not an image").unwrap();
    let mut sensor = sensor(&folder.0, "files = \".\"\nrate_hz = 4.0\nlatency_ms = 100");
    let frames = watch(&mut *sensor, usize::MAX).unwrap();
    let received: Vec<_> =
        frames.iter().map(|(header, pixels)| (header.stamp_ns, header.sequence, pixels[0])).collect();
    assert_eq!(received, [(5_000_000_000, 0, 10), (5_250_000_000, 1, 20), (5_500_000_000, 2, 30)]);
    let (header, pixels) = &frames[1];
    assert_eq!((header.width, header.height, header.stride), (WIDTH, HEIGHT, WIDTH));
    assert_eq!(header.encoding(), Some(Encoding::Gray8));
    assert_eq!(pixels, &vec![20; (WIDTH * HEIGHT) as usize]);
}

#[test]
fn a_pattern_selects_files_and_a_repeated_sequence_restarts() {
    let folder = Folder::new("pattern [1]");
    for (name, level) in [("left_1.png", 1), ("left_2.png", 2), ("right_1.png", 3)] {
        folder.gray(name, level);
    }
    let mut repeated = sensor(&folder.0, "files = \"left_*.png\"\nrepeat = true");
    let levels: Vec<_> = watch(&mut *repeated, 5).unwrap().iter().map(|(_, pixels)| pixels[0]).collect();
    assert_eq!(levels, [1, 2, 1, 2, 1]);
    let mut one = sensor(&folder.0, "files = \"right_1.png\"");
    assert_eq!(watch(&mut *one, usize::MAX).unwrap().len(), 1);
}

#[test]
fn a_late_poll_publishes_only_the_newest_frame() {
    let folder = Folder::new("late");
    (1..=9).for_each(|i| drop(folder.gray(&format!("{i}.png"), i)));
    let mut sensor = sensor(&folder.0, "files = \".\"");
    let mut published = Published::default();
    let mut poll =
        |millis: u64| sensor.poll(Time(millis * 1_000_000), &mut Outputs::new(&mut published)).unwrap();
    assert_eq!(poll(0), Due::At(Time(100_000_000)));
    assert_eq!(poll(50), Due::At(Time(100_000_000)));
    assert_eq!(poll(450), Due::At(Time(500_000_000)));
    assert_eq!(poll(2000), Due::At(Time(900_000_000)), "the last frame is never skipped");
    assert_eq!(poll(2001), Due::Ended);
    let frames = published.of::<FrameHeader>("front");
    let received: Vec<_> = frames.iter().map(|(header, pixels)| (header.sequence, pixels[0])).collect();
    assert_eq!(received, [(0, 1), (4, 5), (8, 9)]);
}

#[test]
fn color_becomes_luma() {
    let folder = Folder::new("color");
    let image = image::RgbaImage::from_pixel(WIDTH, HEIGHT, image::Rgba([0, 255, 0, 128]));
    image.save(folder.0.join("a.png")).unwrap();
    let deep = image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(WIDTH, HEIGHT, image::Luma([0x8080]));
    deep.save(folder.0.join("b.png")).unwrap();
    let frames = watch(&mut *sensor(&folder.0, "files = \".\""), usize::MAX).unwrap();
    assert_eq!((frames[0].1[7], frames[1].1[7]), (150, 128));
}

#[test]
fn missing_files_are_refused() {
    let folder = Folder::new("missing");
    let missing = refusal(&folder.0, "files = \"not-there\"");
    assert!(missing.contains("does not exist") && missing.contains("not-there"), "{missing}");
    let empty = refusal(&folder.0, "files = \".\"");
    assert!(empty.contains("contains no .png, .jpg or .jpeg file"), "{empty}");
    let unmatched = refusal(&folder.0, "files = \"*.png\"");
    assert!(unmatched.contains("no file matches the pattern"), "{unmatched}");
    let pattern = refusal(&folder.0, "files = \"a[.png\"");
    assert!(pattern.contains("is not a valid pattern"), "{pattern}");
}

#[test]
fn invalid_images_are_refused_by_name() {
    let folder = Folder::new("broken");
    folder.gray("a.png", 1);
    let bad = folder.0.join("b.png");
    let refused = |bytes: &[u8], text: &str| {
        std::fs::write(&bad, bytes).unwrap();
        let refusal = refusal(&folder.0, "files = \".\"");
        assert!(
            refusal.contains(text) && refusal.contains("b.png") && refusal.contains("front"),
            "{refusal}"
        );
    };
    refused(b"This is not an image.", "is neither a PNG nor a JPEG file");
    refused(b"", "is neither a PNG nor a JPEG file");
    refused(&std::fs::read(folder.0.join("a.png")).unwrap()[..20], "is truncated");
    refused(b"GIF89a\x20\x00\x18\x00\x00\x00\x00", "is neither a PNG nor a JPEG file");
    image::GrayImage::new(WIDTH + 1, HEIGHT).save(&bad).unwrap();
    let wrong = refusal(&folder.0, "files = \".\"");
    assert!(wrong.contains("b.png has 33x24 pixels, but `intrinsics` has 32x24"), "{wrong}");
    std::fs::remove_file(&bad).unwrap();
    std::fs::create_dir(&bad).unwrap();
    let folder_like_a_file = refusal(&folder.0, "files = \".\"");
    assert!(
        folder_like_a_file.contains("cannot read") && folder_like_a_file.contains("b.png"),
        "{folder_like_a_file}"
    );
}

#[test]
fn a_file_that_is_truncated_or_changed_during_the_run_fails_the_device() {
    for name in ["b.png", "b.jpg"] {
        let folder = Folder::new(&format!("cut-{name}"));
        folder.gray("a.png", 1);
        let path = folder.noise(name);
        let whole = std::fs::read(&path).unwrap();
        let mut complete = sensor(&folder.0, "files = \".\"");
        assert_eq!(watch(&mut *complete, usize::MAX).unwrap().len(), 2);
        for share in [2, 3] {
            let mut opened = sensor(&folder.0, "files = \".\"");
            std::fs::write(&path, &whole[..whole.len() - whole.len() / share]).unwrap();
            let error = watch(&mut *opened, usize::MAX).unwrap_err().to_string();
            assert!(
                error.contains("`front` failed") && error.contains(name) && error.contains("truncated"),
                "{error}"
            );
            let refused = refusal(&folder.0, "files = \".\"");
            assert!(refused.contains(name) && refused.contains("truncated"), "{refused}");
            std::fs::write(&path, &whole).unwrap();
        }
        let mut opened = sensor(&folder.0, "files = \".\"");
        image::GrayImage::new(WIDTH, HEIGHT + 5).save(&path).unwrap();
        let error = watch(&mut *opened, usize::MAX).unwrap_err().to_string();
        assert!(error.contains("has 32x29 pixels"), "{error}");
        std::fs::remove_file(&path).unwrap();
    }
}

#[test]
fn a_file_deleted_during_the_run_is_named() {
    let folder = Folder::new("vanish");
    let path = folder.gray("a.png", 1);
    let mut opened = sensor(&folder.0, "files = \".\"");
    std::fs::remove_file(path).unwrap();
    let error = watch(&mut *opened, usize::MAX).unwrap_err().to_string();
    assert!(error.contains("cannot read") && error.contains("a.png"), "{error}");
}

/// Plays the photographs of a drive down a corridor, if the data set exists.
#[test]
fn photographs_of_a_corridor_are_published() {
    let Some(folder) = yamabico_testkit::data::data_set("corridor_drive") else { return };
    let folder = folder.join("images");
    let table = "files = \".\"\nintrinsics = { width = 960, height = 540 }\nmount = { z_m = 0.3 }";
    let part = PartSpec {
        name: "front".into(),
        kind: "image-sequence".into(),
        table: toml::from_str(table).unwrap(),
    };
    let mut device = driver().open(spec(&folder, part)).unwrap_or_else(|error| panic!("{error}"));
    let begin = std::time::Instant::now();
    let frames = watch(&mut *device.sensors[0].1, usize::MAX).unwrap();
    println!(
        "{} frames, {:.2} ms each",
        frames.len(),
        1e3 * begin.elapsed().as_secs_f64() / frames.len() as f64
    );
    assert_eq!(frames.len(), std::fs::read_dir(&folder).unwrap().count());
    for (header, pixels) in &frames {
        let mean = pixels.iter().map(|&level| f64::from(level)).sum::<f64>() / pixels.len() as f64;
        assert!((40.0..220.0).contains(&mean), "frame {} has a mean of {mean}", header.sequence);
    }
}

#[test]
fn stamps_come_from_the_names_or_from_a_table() {
    let folder = Folder::new("stamps");
    for (i, name) in ["1403636579.100.png", "1403636579.150.png", "1403636579.450.png"].iter().enumerate() {
        folder.gray(name, i as u8);
    }
    std::fs::write(
        folder.0.join("times.csv"),
        "1403636579.100.png,5.0\n1403636579.150.png,5.1\n1403636579.450.png,5.2",
    )
    .unwrap();
    let stamps_of = |keys: &str| {
        let mut device = open(&folder.0, &format!("files = '*.png'\n{keys}")).unwrap();
        let mut tape = Published::default();
        for tick in 0..100 {
            let now = Time::from_secs_f64(1.0 + 0.01 * f64::from(tick));
            device.sensors[0].1.poll(now, &mut Outputs::new(&mut tape)).unwrap();
        }
        let frames = tape.of::<FrameHeader>("front");
        frames.iter().map(|(header, _)| (header.stamp_ns - 1_000_000_000) / 1_000_000).collect::<Vec<_>>()
    };
    assert_eq!(stamps_of("stamps = 'names'"), [0, 50, 350]);
    assert_eq!(stamps_of("stamps = 'times.csv'"), [0, 100, 200]);
    assert_eq!(stamps_of("stamps = 'names'\nrepeat = true")[..5], [0, 50, 350, 450, 500]);
    folder.gray("frame.png", 9);
    for stamps in ["names", "times.csv"] {
        let problem =
            open(&folder.0, &format!("files = '*.png'\nstamps = '{stamps}'")).err().unwrap().to_string();
        assert!(problem.contains("frame.png"), "{problem}");
    }
}
