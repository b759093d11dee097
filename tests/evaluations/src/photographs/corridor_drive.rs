//! Error of the vanishing point's column on a drive along a real corridor.

use std::path::Path;

use clap::Args;
use nalgebra::Vector2;
use yamabico_core::camera::Intrinsics;
use yamabico_vision::segments::{SegmentConfig, SegmentDetector};
use yamabico_vision::vanishing_point::{VanishingPointConfig, VanishingPointFinder};

use super::draw_vanishing_point;
use crate::arguments::Data;
use crate::images::{Output, load_gray};
use crate::report::{Report, Table, number, percent};
use crate::statistics::percentile;

/// Distance of a label from the image center below which it decides no steering direction, px.
const STEERING_DEADBAND_PX: f64 = 10.0;

/// Error of the vanishing point's column on a drive along a real corridor (`corridor_drive/`).
///
/// Compares every labeled frame without prediction. The camera is not calibrated: a focal length of half the image width is assumed,
/// which only limits the distance of the vanishing point from the horizon. A frame without a vanishing point counts as half the
/// image width off and as steered wrongly.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let Some(folder) = self.data.set("corridor_drive") else { return Ok(Report::default()) };
        let (mut errors, mut found, mut steered, mut correct) = (Vec::new(), 0_usize, 0_usize, 0_usize);
        for (name, label) in labels(&folder)? {
            let image = load_gray(&folder.join("images").join(format!("{name}.jpg")))?;
            let view = image.view().map_err(|error| format!("{name}: {error}"))?;
            let (width, height) = (view.width() as f64, view.height() as f64);
            let camera = Intrinsics {
                fx: 0.5 * width,
                fy: 0.5 * width,
                cx: 0.5 * (width - 1.0),
                cy: 0.5 * (height - 1.0),
                width: view.width() as u32,
                height: view.height() as u32,
            };
            let mut detector = SegmentDetector::new(SegmentConfig::default());
            let mut finder = VanishingPointFinder::new(VanishingPointConfig::default());
            let segments = detector.detect(view).unwrap_or_default();
            let point = finder.find(segments, &camera, None);
            out.overlay(&name, view, |canvas| {
                draw_vanishing_point(canvas, segments, point.as_ref().ok(), label);
            })?;
            let column = point.ok().map(|point| point.pixel.x);
            found += usize::from(column.is_some());
            errors.push(column.map_or(0.5 * width, |u| (u - label.x).abs()));
            let offset = label.x - camera.cx;
            if offset.abs() > STEERING_DEADBAND_PX {
                steered += 1;
                correct += usize::from(column.is_some_and(|u| (u - camera.cx) * offset > 0.0));
            }
        }
        if errors.is_empty() {
            return Err(format!("{}: no labeled frame", folder.display()));
        }
        let mut table = Table::new(
            format!("Corridor drive (steering: labels more than {STEERING_DEADBAND_PX} px off the center)"),
            &["frames", "found", "median, px", "90 %, px", "steered", "correct sign", "correct, %"],
        );
        table.row([
            errors.len().into(),
            found.into(),
            number(percentile(&errors, 0.5), 1),
            number(percentile(&errors, 0.9), 1),
            steered.into(),
            correct.into(),
            percent(correct as f64, steered.max(1) as f64),
        ]);
        Ok(Report::new([table]))
    }
}

/// Reads name and labeled vanishing point of every frame that has one.
fn labels(folder: &Path) -> Result<Vec<(String, Vector2<f64>)>, String> {
    let path = folder.join("labels.csv");
    let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let mut labels = Vec::new();
    for line in text.lines().skip(1) {
        // The polygons between the quotes contain commas; the point is the last two fields.
        let name = line.split(',').next().unwrap_or_default();
        let mut last = line.rsplit(',');
        let (v, u) = (last.next().unwrap_or_default(), last.next().unwrap_or_default());
        if let (Ok(u), Ok(v)) = (u.trim().parse(), v.trim().parse()) {
            labels.push((name.to_owned(), Vector2::new(u, v)));
        }
    }
    Ok(labels)
}
