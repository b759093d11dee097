//! The page draws over a picture what the recording holds for the same frame, as pictures on disk show it.

use image::RgbImage;
use serde_json::Value;
use yamabico_core::message::{FrameHeader, Message, MessageType, OverlayHeader, OverlayMark};
use yamabico_core::time::Time;
use yamabico_runtime::overlay_painter::with_overlays;
use yamabico_runtime::record::{Tap, play};
use yamabico_testkit::config;

use super::browser::Browser;
use super::{View, find_recording};
use crate::program::{TestFolder, yamabico};

/// Distance within which both drawings count as the same, pixels.
const NEAR_PX: i64 = 3;
/// Minimum share of one drawing that is also in the other: letters and dots differ in size.
const MIN_SHARE: f64 = 0.85;

/// Frame with this stamp and what was drawn over it.
struct Drawn {
    stamp_ns: u64,
    picture: Option<RgbImage>,
    marks: Vec<Vec<OverlayMark>>,
}

impl Tap for Drawn {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], items: &[u8]) {
        match message.name {
            FrameHeader::NAME => {
                let header: FrameHeader = bytemuck::pod_read_unaligned(header);
                if header.stamp_ns == self.stamp_ns {
                    let (width, height) = (header.width, header.height);
                    let bytes = items.len() as u32 / (width * height);
                    let pixel = |u, v| {
                        let first = ((v * width + u) * bytes) as usize;
                        [0, 1, 2].map(|part| items[first + if bytes == 3 { part } else { 0 }])
                    };
                    self.picture = Some(RgbImage::from_fn(width, height, |u, v| image::Rgb(pixel(u, v))));
                }
            }
            OverlayHeader::NAME => {
                let header: OverlayHeader = bytemuck::pod_read_unaligned(header);
                if header.stamp_ns == self.stamp_ns {
                    let marks =
                        items.chunks_exact(size_of::<OverlayMark>()).map(bytemuck::pod_read_unaligned);
                    self.marks.push(marks.collect());
                }
            }
            _ => {}
        }
    }
}

#[test]
fn the_page_draws_what_the_recording_holds() {
    let Some(mut browser) = Browser::start("the_page_draws_what_the_recording_holds") else { return };
    let folder = TestFolder::new("view-overlays");
    let mut run = yamabico();
    run.arg("run").arg(config("corridor.toml")).args(["--set", "run.duration_s=4", "--no-report"]);
    run.arg("--out").arg(folder.path()).output().unwrap();
    let recording = find_recording(folder.path()).expect("a recording");
    let view = View::start(recording.to_str().unwrap(), &folder);
    browser.resize(1400, 1000);
    browser.open(&view.url);
    browser.await_true("yamabico.memory.state.source.source == 'recording'");
    browser.evaluate("yamabico.command({ command: 'seek', at_s: 3 })");
    browser.await_true(
        "yamabico.memory.state.time_s > 2.9 && document.querySelectorAll('#layers input').length > 1",
    );
    let stamp = "document.querySelector('#camera').dataset.stamp";
    browser.await_true(&format!("{stamp} == yamabico.memory.state.pictures[0].overlaid"));
    let with = canvas(&mut browser);
    let stamp_ns: u64 = browser.evaluate(stamp).as_str().unwrap().parse().unwrap();
    browser.evaluate("document.querySelectorAll('#layers input').forEach(box => box.click())");
    let mut without = canvas(&mut browser);
    while without == with {
        without = canvas(&mut browser);
    }

    let mut drawn = Drawn { stamp_ns, picture: None, marks: Vec::new() };
    play(&recording, &mut drawn).unwrap();
    let picture = drawn.picture.expect("the frame is in the recording");
    let marks: Vec<&[OverlayMark]> = drawn.marks.iter().map(Vec::as_slice).collect();
    assert!(!marks.is_empty(), "overlays of the frame are in the recording");
    let on_disk =
        difference(&with_overlays(&picture, &marks, &|_| true), &with_overlays(&picture, &[], &|_| true));
    let on_page = difference(&with, &without);
    let scale = f64::from(with.width()) / f64::from(picture.width());
    let enlarged = f64::from(with_overlays(&picture, &[], &|_| true).width()) / f64::from(picture.width());
    let to_frame = |points: &[[u32; 2]], scale: f64| -> Vec<[i64; 2]> {
        points.iter().map(|point| point.map(|pixel| (f64::from(pixel) / scale) as i64)).collect()
    };
    let (on_disk, on_page) = (to_frame(&on_disk, enlarged), to_frame(&on_page, scale));
    let shares = [share(&on_page, &on_disk), share(&on_disk, &on_page)];
    println!("{} and {} pixels are drawn; in the other drawing: {shares:.2?}", on_page.len(), on_disk.len());
    assert!(on_page.len() > 200 && shares.iter().all(|share| *share > MIN_SHARE), "{shares:.2?}");
}

/// Picture of the page's camera panel.
fn canvas(browser: &mut Browser) -> RgbImage {
    let bytes = browser.evaluate(
        "new Promise(done => document.querySelector('#camera').toBlob(async blob => \
         done(Array.from(new Uint8Array(await blob.arrayBuffer()))), 'image/png'))",
    );
    let bytes: Vec<u8> =
        bytes.as_array().unwrap().iter().map(|byte| Value::as_u64(byte).unwrap() as u8).collect();
    image::load_from_memory(&bytes).unwrap().into_rgb8()
}

/// Pixels in which two pictures differ clearly.
fn difference(a: &RgbImage, b: &RgbImage) -> Vec<[u32; 2]> {
    assert_eq!(a.dimensions(), b.dimensions());
    let differs = |(a, b): (&image::Rgb<u8>, &image::Rgb<u8>)| (0..3).any(|i| a.0[i].abs_diff(b.0[i]) > 60);
    let pixels = a.pixels().zip(b.pixels()).enumerate().filter(|(_, pair)| differs(*pair));
    pixels.map(|(i, _)| [i as u32 % a.width(), i as u32 / a.width()]).collect()
}

/// Share of `points` with one of `others` nearby.
fn share(points: &[[i64; 2]], others: &[[i64; 2]]) -> f64 {
    let others: std::collections::BTreeSet<[i64; 2]> = others.iter().copied().collect();
    let is_near = |[x, y]: &&[i64; 2]| {
        let around = -NEAR_PX..=NEAR_PX;
        around.clone().any(|dx| around.clone().any(|dy| others.contains(&[x + dx, y + dy])))
    };
    points.iter().filter(is_near).count() as f64 / points.len().max(1) as f64
}
