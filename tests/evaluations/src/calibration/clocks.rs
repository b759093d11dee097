//! Offsets between the clocks of camera and odometry, from rendered turns.

use std::ops::Range;

use rand::RngExt;
use rand_distr::{Distribution, Normal};
use yamabico_core::camera::{Intrinsics, Mount, Pinhole};
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_sim::random::stream;
use yamabico_sim::{CameraView, Photometry, Renderer, Scene, World};
use yamabico_vision::calibration::clock_offset::fit_clock_offset;
use yamabico_vision::calibration::float_image::FloatImage;
use yamabico_vision::calibration::heading_track::{HeadingTrack, TimedTurn};
use yamabico_vision::calibration::turn_rate::HorizonBand;

use super::{COLUMNS, errors_row};
use crate::report::Table;

/// Length of a recording, s, period of its frames, s, and of its odometry, s.
const SECONDS: f64 = 20.0;
const FRAME_S: f64 = 0.1;
const ODOMETRY_S: f64 = 0.02;
/// Amplitudes of the turns, rad: along the corridor, and until the camera faces its walls.
const ALONG_RAD: f64 = 0.6;
const TO_WALLS_RAD: f64 = 1.4;

/// Errors of the offset, ms and standard deviations.
pub fn table(seeds: Range<u64>) -> Result<Table, String> {
    let title = format!(
        "{} recordings of {SECONDS} s of turns, frames of 320 x 240 at {} Hz",
        seeds.end - seeds.start,
        1.0 / FRAME_S
    );
    let mut table = Table::new(title, &COLUMNS);
    for (name, amplitude) in [("offset", ALONG_RAD), ("offset where walls are faced", TO_WALLS_RAD)] {
        let (errors_ms, sigmas, recordings) = errors(seeds.clone(), amplitude)?;
        errors_row(&mut table, &format!("{name}, ms"), &errors_ms, recordings);
        errors_row(&mut table, &format!("{name}, standard deviations"), &sigmas, recordings);
    }
    Ok(table)
}

/// Errors of the offset, ms and standard deviations, by turns of this amplitude, and the number of recordings.
fn errors(seeds: Range<u64>, amplitude: f64) -> Result<(Vec<f64>, Vec<f64>, usize), String> {
    let [mut errors_ms, mut sigmas] = [const { Vec::new() }; 2];
    let mut recordings = 0;
    for seed in seeds {
        let mut rng = stream(seed, "clock");
        let mut near = |middle: f64, range: f64| rng.random_range(middle - range..middle + range);
        let offset_s = near(0.05, 0.2);
        let (slow, fast, phase) = (near(0.7, 0.2), near(1.9, 0.4), near(0.0, 3.0));
        let heading =
            |seconds: f64| amplitude * (slow * seconds).sin() + 0.2 * (fast * seconds + phase).sin();
        let intrinsics = Intrinsics::from_horizontal_fov(320, 240, 1.1);
        let (pinhole, mount) = (Pinhole::ideal(intrinsics), Mount::tilted(0.5, near(0.05, 0.1)));
        let scene = Scene::new(&World::random_corridor(seed, 2.0), 0).map_err(|error| error.to_string())?;
        let mut renderer = Renderer::new(
            Photometry { noise_sigma: 4.0, blur_px: 0.6, ..Photometry::default() },
            stream(seed, "noise"),
        );
        let place = (near(3.0, 2.0), near(0.0, 0.3), near(0.0, 0.3));
        let (mut turns, mut last): (Vec<TimedTurn>, Option<(f64, HorizonBand)>) = (Vec::new(), None);
        for frame in 0..(SECONDS / FRAME_S) as usize {
            let seconds = 1.0 + FRAME_S * frame as f64;
            let robot = Pose2::new(place.0, place.1, place.2 + heading(seconds));
            let mut picture = GrayImage::new(320, 240);
            let view = CameraView { intrinsics, mount, robot };
            renderer.render(&scene, &view, picture.pixels_mut()).map_err(|error| error.to_string())?;
            let picture = FloatImage::of(picture.view().map_err(|error| error.to_string())?);
            let (stamp, band) =
                (seconds + offset_s, HorizonBand::of(&picture.smoothed(1.0), &pinhole, &mount));
            if let Some((from_s, earlier)) = &last
                && let Some(seen) = earlier.turn_to(&band)
            {
                turns.push(TimedTurn { from_s: *from_s, to_s: stamp, turn: seen.turn });
            }
            last = Some((stamp, band));
        }
        let noise = Normal::new(0.0, 1e-3).map_err(|error| error.to_string())?;
        let mut track = HeadingTrack::default();
        for reading in 0..((SECONDS + 2.0) / ODOMETRY_S) as usize {
            let seconds = ODOMETRY_S * reading as f64;
            // Wheels that say 2 % too little.
            track.push(seconds, 0.98 * heading(seconds) + noise.sample(&mut rng));
        }
        recordings += 1;
        if let Ok(found) = fit_clock_offset(&turns, &track) {
            errors_ms.push(1e3 * (found.offset_s - offset_s));
            sigmas.push((found.offset_s - offset_s) / found.sigma_s);
        }
    }
    Ok((errors_ms, sigmas, recordings))
}
