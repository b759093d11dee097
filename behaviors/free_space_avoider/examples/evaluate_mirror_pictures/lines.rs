//! How far from the field's lines the pixels of lines end up.

use std::path::Path;

use nalgebra::{Rotation2, Vector2, Vector3};
use serde_json::Value;

use super::{HEIGHT_M, camera};

/// The picture whose mirror was measured well.
const PICTURE: &str = "nudt_2";
/// So far off the stated pose the search begins: m, m, rad.
const AWAY: [f64; 3] = [0.15, -0.1, 0.04];
/// First and last steps of the search: m, and rad for each meter.
const STEPS: [f64; 2] = [0.1, 0.0005];
const RAD_PER_M: f64 = 0.2;

/// Prints the mean and the median distance.
///
/// # Errors
/// Files that are not as they should be.
pub fn residual(folder: &Path, calibration: &Value) -> Result<(), String> {
    let team = &calibration["nudt"];
    let size = image::image_dimensions(folder.join(format!("{PICTURE}.png"))).map_err(|e| e.to_string())?;
    let camera = camera(team, size)?;
    let text = std::fs::read_to_string(folder.join(format!("{PICTURE}_white_pixels.csv")))
        .map_err(|e| e.to_string())?;
    let mut points = Vec::new();
    for line in text.lines().skip(1) {
        let numbers: Result<Vec<f64>, _> = line.split(',').map(str::parse).collect();
        let Ok([u, v]) = numbers.as_deref() else { return Err(format!("no pixel: {line}")) };
        let from_center = Vector2::new(*u, *v) - camera.image().center();
        if let Some(floor_m) = camera.floor_radius_m(from_center.norm(), HEIGHT_M) {
            // The map of the field is seen as the image is, from above with y to the right.
            points.push(from_center.normalize() * floor_m);
        }
    }
    let lines = LineDistances::read(folder)?;
    let stated = &team["reference_pose_nudt_2"];
    let of = |key: &str| stated[key].as_f64().ok_or(format!("calibration.json: no {key}"));
    let stated = Vector3::new(0.01 * of("x_cm")?, 0.01 * of("y_cm")?, of("theta_rad")?);
    let mean = |pose: &Vector3<f64>| lines.of(&points, pose).iter().sum::<f64>() / points.len() as f64;
    let mut pose = stated + Vector3::from(AWAY);
    let mut step = STEPS[0];
    while step > STEPS[1] {
        let moves = [Vector3::x(), Vector3::y(), Vector3::z() * RAD_PER_M];
        let tries = moves.iter().flat_map(|along| [pose + along * step, pose - along * step]);
        match tries.map(|pose| (mean(&pose), pose)).min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((value, better)) if value < mean(&pose) => pose = better,
            _ => step *= 0.5,
        }
    }
    let mut distances = lines.of(&points, &pose);
    distances.sort_by(f64::total_cmp);
    let within = distances.iter().filter(|distance| **distance <= 0.1).count();
    println!(
        "{PICTURE}: {} of {} line pixels lie on the floor, {:.1} cm from a line in the mean, {:.1} cm in the median, {:.1} % within 10 cm; \
         pose {:.2} m, {:.2} m, {:.1} deg, {:.1} cm from the stated one",
        points.len(),
        text.lines().count() - 1,
        100.0 * distances.iter().sum::<f64>() / distances.len() as f64,
        100.0 * distances[distances.len() / 2],
        100.0 * within as f64 / distances.len() as f64,
        pose.x,
        pose.y,
        pose.z.to_degrees(),
        100.0 * (pose - stated).xy().norm(),
    );
    Ok(())
}

/// The distance to the nearest line of the field, one value a square centimeter.
struct LineDistances(image::GrayImage);

impl LineDistances {
    fn read(folder: &Path) -> Result<Self, String> {
        let path = folder.join("field18x12_line_distance_cm.png");
        Ok(Self(image::open(&path).map_err(|e| format!("{}: {e}", path.display()))?.to_luma8()))
    }

    /// Distances of points seen from a pose, meters; outside of the map, as far as the map tells.
    fn of(&self, points: &[Vector2<f64>], pose: &Vector3<f64>) -> Vec<f64> {
        let turned = Rotation2::new(pose.z);
        let distance = |point: &Vector2<f64>| {
            let at = (pose.xy() + turned * point) * 100.0 + Vector2::new(1000.0, 700.0);
            let column = at.x.round().clamp(0.0, f64::from(self.0.width() - 1)) as u32;
            let row = at.y.round().clamp(0.0, f64::from(self.0.height() - 1)) as u32;
            0.01 * f64::from(self.0.get_pixel(column, row).0[0])
        };
        points.iter().map(distance).collect()
    }
}
