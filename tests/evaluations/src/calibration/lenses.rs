//! Lenses from rendered boards.

use std::ops::Range;

use nalgebra::{Point3, Vector2};
use rand::RngExt;
use yamabico_core::camera::{Distortion, Intrinsics, Pinhole};
use yamabico_rigs::board::{INDOORS, held_board, render_board};
use yamabico_sim::random::stream;
use yamabico_vision::calibration::{Board, calibrate_lens, find_board};

use super::{COLUMNS, errors_row};
use crate::images::Output;
use crate::report::{Table, number};

/// Number of pictures of each lens.
const PICTURES: usize = 15;

/// Errors of focal length, principal point, corners, and of the whole lens over the image.
pub fn tables(seeds: Range<u64>, out: &Output) -> Result<[Table; 2], String> {
    let board = Board::new("9x6", 0.025).map_err(|error| error.to_string())?;
    let [mut focal, mut center, mut map, mut corners, mut sigmas] = [const { Vec::new() }; 5];
    let (mut shown, mut lenses) = (0, 0);
    let mut each = Table::new(
        "Lenses, true and measured",
        &["seed", "fx", "fy", "cx", "cy", "measured fx", "fy", "cx", "cy"],
    );
    for seed in seeds {
        let mut rng = stream(seed, "lens");
        let mut near = |middle: f64, range: f64| rng.random_range(middle - range..middle + range);
        let fx = near(560.0, 100.0);
        let truth = Intrinsics {
            fx,
            fy: fx * near(1.0, 0.01),
            cx: near(320.0, 12.0),
            cy: near(240.0, 12.0),
            width: 640,
            height: 480,
        };
        let distortion = Distortion {
            k1: near(-0.18, 0.14),
            k2: near(0.05, 0.05),
            p1: near(0.0, 1e-3),
            p2: near(0.0, 1e-3),
            k3: 0.0,
        };
        let pinhole = Pinhole::new(truth, distortion);
        let mut found = Vec::new();
        for picture_number in 0..PICTURES {
            let pose = held_board(&board, &pinhole, &mut rng);
            let picture = render_board(&board, &pinhole, &pose, INDOORS, &mut rng);
            let view = picture.view().map_err(|error| error.to_string())?;
            if out.is_on() {
                out.gray(
                    &format!("lens_{seed}_{picture_number:02}"),
                    picture.pixels(),
                    truth.width,
                    truth.height,
                )?;
            }
            shown += 1;
            let Ok(seen) = find_board(view, &board) else { continue };
            let at = |corner: Vector2<f64>| pinhole.project(&(pose * Point3::from(corner.push(0.0))));
            let off = |(corner, seen): (Vector2<f64>, &Vector2<f64>)| {
                at(corner).map_or(f64::NAN, |at| (at - seen).norm())
            };
            corners.extend(board.corners().into_iter().zip(&seen.corners).map(off));
            found.push(seen);
        }
        lenses += 1;
        let Ok(calibrated) = calibrate_lens(&board, &found, truth.size()) else { continue };
        let lens = calibrated.lens.pinhole;
        let at = lens.intrinsics();
        focal.extend([at.fx - truth.fx, at.fy - truth.fy]);
        center.extend([at.cx - truth.cx, at.cy - truth.cy]);
        sigmas.push((at.fx - truth.fx) / calibrated.lens.sigmas[0]);
        let numbers =
            [truth.fx, truth.fy, truth.cx, truth.cy, at.fx, at.fy, at.cx, at.cy].map(|px| number(px, 2));
        let [a, b, c, d, e, f, g, h] = numbers;
        each.row([seed.into(), a, b, c, d, e, f, g, h]);
        // The same ray in both lenses, over the image.
        let off = |i: i32| {
            let pixel = Vector2::new(32.0 + 64.0 * f64::from(i % 10), 30.0 + 60.0 * f64::from(i / 10));
            let ray = pinhole.normalized_from_pixel(pixel)?;
            Some((lens.project(&Point3::from(ray.push(1.0))).ok()? - pixel).norm())
        };
        map.extend((0..80).filter_map(off));
    }
    let mut table = Table::new(format!("{lenses} lenses, {PICTURES} pictures of 640 x 480 each"), &COLUMNS);
    errors_row(&mut table, "corner, px", &corners, shown * board.count());
    errors_row(&mut table, "focal lengths, px", &focal, 2 * lenses);
    errors_row(&mut table, "principal point, px", &center, 2 * lenses);
    errors_row(&mut table, "whole lens, px over the image", &map, 80 * lenses);
    errors_row(&mut table, "focal length, standard deviations", &sigmas, lenses);
    Ok([table, each])
}
