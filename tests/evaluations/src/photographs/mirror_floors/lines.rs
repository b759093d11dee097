//! Distance of projected field-line pixels from the lines of the field.

use std::path::Path;

use nalgebra::{Rotation2, Vector2, Vector3};
use serde_json::Value;

use super::{HEIGHT_M, camera};
use crate::report::{Table, number, percent};
use crate::statistics::mean;

/// Image whose mirror was calibrated well.
const IMAGE: &str = "nudt_2";
/// Start of the search relative to the reference pose: m, m, rad.
const START_OFFSET: [f64; 3] = [0.15, -0.1, 0.04];
/// First and last step of the search, m.
const STEPS_M: [f64; 2] = [0.1, 0.0005];
/// Step in heading for each meter of a step, rad.
const RAD_PER_M: f64 = 0.2;

/// Fits the pose to the labeled pixels and returns the distances of the pixels from the lines.
///
/// # Errors
/// If a file is missing or invalid.
pub fn residual(folder: &Path, calibration: &Value) -> Result<Table, String> {
    let team = &calibration["nudt"];
    let size = image::image_dimensions(folder.join(format!("{IMAGE}.png"))).map_err(|e| e.to_string())?;
    let camera = camera(team, size)?;
    let text = std::fs::read_to_string(folder.join(format!("{IMAGE}_white_pixels.csv")))
        .map_err(|error| format!("{IMAGE}_white_pixels.csv: {error}"))?;
    let mut points = Vec::new();
    for line in text.lines().skip(1) {
        let numbers: Result<Vec<f64>, _> = line.split(',').map(str::parse).collect();
        let Ok([u, v]) = numbers.as_deref() else { return Err(format!("not a pixel: {line}")) };
        let from_center = Vector2::new(*u, *v) - camera.image().center();
        if let Some(floor_m) = camera.floor_radius_m(from_center.norm(), HEIGHT_M) {
            // The map of the field has its y axis to the right, like the image.
            points.push(from_center.normalize() * floor_m);
        }
    }
    let lines = LineDistances::read(folder)?;
    let reference = &team["reference_pose_nudt_2"];
    let value = |key: &str| reference[key].as_f64().ok_or(format!("calibration.json: no {key}"));
    let reference = Vector3::new(0.01 * value("x_cm")?, 0.01 * value("y_cm")?, value("theta_rad")?);
    let mean_m = |pose: &Vector3<f64>| mean(&lines.of(&points, pose));
    let mut pose = reference + Vector3::from(START_OFFSET);
    let mut step = STEPS_M[0];
    while step > STEPS_M[1] {
        let moves = [Vector3::x(), Vector3::y(), Vector3::z() * RAD_PER_M];
        let candidates = moves.iter().flat_map(|along| [pose + along * step, pose - along * step]);
        match candidates.map(|pose| (mean_m(&pose), pose)).min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((value, better)) if value < mean_m(&pose) => pose = better,
            _ => step *= 0.5,
        }
    }
    let mut distances = lines.of(&points, &pose);
    distances.sort_by(f64::total_cmp);
    let within = distances.iter().filter(|distance| **distance <= 0.1).count();
    let mut table = Table::new(
        format!("Line pixels of {IMAGE} projected onto the field"),
        &[
            "pixels",
            "on the floor",
            "mean, cm",
            "median, cm",
            "within 10 cm, %",
            "x, m",
            "y, m",
            "heading, deg",
            "from reference, cm",
        ],
    );
    table.row([
        (text.lines().count() - 1).into(),
        points.len().into(),
        number(100.0 * mean(&distances), 1),
        number(100.0 * distances[distances.len() / 2], 1),
        percent(within as f64, distances.len() as f64),
        number(pose.x, 2),
        number(pose.y, 2),
        number(pose.z.to_degrees(), 1),
        number(100.0 * (pose - reference).xy().norm(), 1),
    ]);
    Ok(table)
}

/// Distance to the nearest line of the field, one pixel per square centimeter.
struct LineDistances(image::GrayImage);

impl LineDistances {
    fn read(folder: &Path) -> Result<Self, String> {
        let path = folder.join("field18x12_line_distance_cm.png");
        Ok(Self(image::open(&path).map_err(|error| format!("{}: {error}", path.display()))?.to_luma8()))
    }

    /// Returns the distances of points in the robot frame of a pose, m; points outside the map are clamped to it.
    fn of(&self, points: &[Vector2<f64>], pose: &Vector3<f64>) -> Vec<f64> {
        let rotation = Rotation2::new(pose.z);
        let distance = |point: &Vector2<f64>| {
            let at = (pose.xy() + rotation * point) * 100.0 + Vector2::new(1000.0, 700.0);
            let column = at.x.round().clamp(0.0, f64::from(self.0.width() - 1)) as u32;
            let row = at.y.round().clamp(0.0, f64::from(self.0.height() - 1)) as u32;
            0.01 * f64::from(self.0.get_pixel(column, row).0[0])
        };
        points.iter().map(distance).collect()
    }
}
