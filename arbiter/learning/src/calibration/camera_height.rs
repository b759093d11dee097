//! Height of a camera above the floor, by the width of a corridor and by the motion of the floor.

use yamabico_core::camera::{Mount, Pinhole};
use yamabico_core::geometry::{Pose2, angle_difference};
use yamabico_vision::calibration::corridor_height::{height_of, width_in_heights};
use yamabico_vision::calibration::corridor_sight::CorridorSight;
use yamabico_vision::calibration::float_image::FloatImage;
use yamabico_vision::calibration::floor_motion::{FloorMotion, FloorPair, fit_floor_motion};

use super::Measured;
use super::pictures::Picture;

/// Distance between two frames whose floor is compared, m, and largest turn between them, rad.
const PAIR_M: std::ops::RangeInclusive<f64> = 0.08..=0.5;
const PAIR_RAD: f64 = 0.08;
/// Maximum number of pairs.
const MAX_PAIRS: usize = 32;
/// Smoothing of frames whose floor is compared, px.
const SMOOTHING_PX: f64 = 1.0;
/// Height assumed where nothing is known, m.
const ASSUMED_M: f64 = 0.4;

/// Height by the width of the corridor, m. Which lines are walls depends on the height, so it is computed again with its first result.
pub(super) fn by_width(
    pictures: &[Picture],
    sights: &[CorridorSight],
    pinhole: &Pinhole,
    mount: &Mount,
    width_m: f64,
) -> Option<Measured> {
    let mut assumed_m = if mount.z > 0.0 { mount.z } else { ASSUMED_M };
    let mut found = None;
    for _ in 0..3 {
        let of = |(picture, _): (&Picture, &CorridorSight)| {
            width_in_heights(picture.gray.view().ok()?, pinhole, &Mount { z: assumed_m, ..*mount })
        };
        let seen = pictures.iter().zip(sights).filter(|(_, sight)| sight.point.is_some());
        let widths: Vec<f64> = seen.filter_map(of).collect();
        found = height_of(&widths, width_m);
        let next = found.as_ref()?.height_m;
        let is_settled = (next / assumed_m - 1.0).abs() < 0.02;
        assumed_m = next;
        if is_settled {
            break;
        }
    }
    found.map(|height| Measured::new(height.height_m, height.sigma_m))
}

/// Height and pan by the motion of the floor.
pub(super) fn by_floor_motion(
    pictures: &[Picture],
    poses: &[Option<Pose2>],
    pinhole: &Pinhole,
    mount: &Mount,
) -> Result<FloorMotion, String> {
    let mut chosen: Vec<(usize, usize)> = Vec::new();
    for (first, pose) in poses.iter().enumerate() {
        let Some(pose) = pose else { continue };
        // Pairs at several distances, so that a regular floor cannot fit all of them wrongly.
        let wanted_m = [0.12, 0.2, 0.3][first % 3];
        let distance = |other: &Pose2| pose.distance(other);
        let later = poses.iter().enumerate().skip(first + 1).take(12);
        let later = later.filter_map(|(index, other)| Some((index, (*other)?)));
        let straight = later.filter(|(_, other)| {
            PAIR_M.contains(&distance(other)) && angle_difference(other.theta, pose.theta).abs() < PAIR_RAD
        });
        let off = |other: &Pose2| (distance(other) - wanted_m).abs();
        let best = straight.min_by(|a, b| off(&a.1).total_cmp(&off(&b.1)));
        chosen.extend(best.map(|(second, _)| (first, second)));
    }
    let step = chosen.len().div_ceil(MAX_PAIRS).max(1);
    let chosen: Vec<(usize, usize)> = chosen.into_iter().step_by(step).collect();
    let smooth = |index: usize| -> Option<FloatImage> {
        Some(FloatImage::of(pictures[index].gray.view().ok()?).smoothed(SMOOTHING_PX))
    };
    let images: Vec<([FloatImage; 2], [Pose2; 2])> = chosen
        .iter()
        .filter_map(|(a, b)| Some(([smooth(*a)?, smooth(*b)?], [poses[*a]?, poses[*b]?])))
        .collect();
    let pairs: Vec<FloorPair<'_>> = images
        .iter()
        .map(|(images, poses)| FloorPair { pictures: [&images[0], &images[1]], poses: *poses })
        .collect();
    fit_floor_motion(pinhole, mount, &pairs).map_err(|error| error.to_string())
}
