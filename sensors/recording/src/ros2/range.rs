//! Range scans of ROS 2.

use serde::Deserialize;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Beam, NO_ECHO, RangeScanHeader};
use yamabico_core::range_scan::LaserScanner;

use super::{Header, finite};
use crate::measurement::{Measurement, Refusal};

#[derive(Deserialize)]
pub(super) struct LaserScan {
    header: Header,
    angle_min: f32,
    _angle_max: f32,
    angle_increment: f32,
    _time_increment: f32,
    _scan_time: f32,
    range_min: f32,
    range_max: f32,
    ranges: Vec<f32>,
}

pub(super) fn scan(message: &LaserScan) -> Result<Measurement, Refusal> {
    let scanner = LaserScanner {
        first_rad: f64::from(message.angle_min),
        step_rad: f64::from(message.angle_increment),
        min_m: f64::from(message.range_min),
        max_m: f64::from(message.range_max),
        mount: Pose2::IDENTITY,
    };
    let mut beams = Vec::new();
    let converted = scanner.beams(message.ranges.iter().copied(), &mut beams);
    converted.map_err(|error| Refusal::Malformed(error.to_string()))?;
    let (min_m, max_m) = (scanner.min_m, scanner.max_m);
    let header = RangeScanHeader { stamp_ns: message.header.stamp_ns(), sequence: 0, min_m, max_m };
    Ok(Measurement::Scan(header, beams))
}

#[derive(Deserialize)]
pub(super) struct Range {
    header: Header,
    _radiation_type: u8,
    field_of_view: f32,
    min_range: f32,
    max_range: f32,
    range: f32,
}

pub(super) fn range(message: &Range) -> Result<Measurement, Refusal> {
    let (min_m, max_m, range_m) =
        (f64::from(message.min_range), f64::from(message.max_range), f64::from(message.range));
    finite(&[f64::from(message.field_of_view), min_m, max_m], "a range")?;
    if range_m.is_nan() {
        return Err(Refusal::Malformed("a range that is no number".to_owned()));
    }
    let has_echo = range_m <= max_m;
    let beam = Beam {
        cone_rad: f64::from(message.field_of_view),
        range_m: if has_echo { range_m.max(min_m) } else { max_m },
        flags: if has_echo { 0 } else { NO_ECHO },
        ..Beam::default()
    };
    let header = RangeScanHeader { stamp_ns: message.header.stamp_ns(), sequence: 0, min_m, max_m };
    Ok(Measurement::Scan(header, vec![beam]))
}
