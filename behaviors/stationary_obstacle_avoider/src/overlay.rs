//! Overlay of the passage methods: the edges that the map explains, lacks or lets expect, the regions with their counts against the
//! limits, and the known obstacles from above.

use nalgebra::{Point2, Vector2};
use yamabico_core::geometry::Pose2;
use yamabico_core::overlay::{BLUE, Color, GRAY, GREEN, MAGENTA, ORANGE, Overlay, RED, YELLOW};

use crate::detector::Detector;
use crate::obstacle_memory::KnownObstacle;

/// Length of the line toward the aim, m.
const AIM_M: f64 = 1.5;

/// Draws the evidence of `detector` in its last frame.
pub fn draw_evidence(overlay: &mut Overlay, detector: &Detector) {
    let (seen, expected, level) = (detector.seen(), detector.expected(), detector.level());
    let [width, height] = [seen.width(), seen.height()];
    let extra = |u: usize, v: usize| detector.difference().is_extra(seen, u, v);
    let at = |u: usize, v: usize| Vector2::new(u as f64, v as f64);
    let mut layer = |name: &str, color: Color, is_set: &dyn Fn(usize, usize) -> bool| {
        let mut layer = overlay.image(name, color);
        for u in 0..width {
            let mut begin = None;
            for v in 0..=height {
                let is_on = v < height && is_set(u, v);
                begin = match begin {
                    None if is_on => Some(v),
                    Some(top) if !is_on => {
                        layer.line(at(u, top), at(u, v - 1));
                        None
                    }
                    begin => begin,
                };
            }
        }
    };
    layer("edges of the map, expected", BLUE, &|u, v| expected.get(u, v) && !seen.get(u, v));
    layer("edges explained by the map", GREEN, &|u, v| seen.get(u, v) && !extra(u, v));
    layer("edges not on the map", RED, &|u, v| seen.get(u, v) && extra(u, v));
    let mut across = overlay.image("level edges not on the map", ORANGE);
    let mut run: Option<(usize, usize, usize)> = None;
    for (u, v) in level.pixels().chain([(usize::MAX, usize::MAX)]) {
        run = match run {
            Some((first, last, row)) if row == v && last + 1 == u => Some((first, u, row)),
            Some((first, last, row)) => {
                across.line(at(first, row), at(last, row));
                Some((u, u, v))
            }
            None => Some((u, u, v)),
        };
    }
    let last = height as f64 - 1.0;
    for (name, color, is_obstacle) in [("free regions", GRAY, false), ("obstacle regions", YELLOW, true)] {
        let mut regions = overlay.image(name, color);
        for (region, result) in detector.results().iter().enumerate() {
            if result.is_obstacle != is_obstacle {
                continue;
            }
            let columns = detector.regions().columns(region);
            let (first, end) = (columns.start as f64, columns.end as f64 - 1.0);
            regions.frame(Vector2::new(first, 0.0), Vector2::new(end, last));
            let counts = Vector2::new(first + 2.0, if region % 2 == 0 { 2.0 } else { 10.0 });
            regions.text(counts, format_args!("{}/{:.0}", result.extra, result.limit));
            if result.is_step {
                regions.line(result.step.foot, Vector2::new(result.step.foot.x, result.step.top_v));
            }
        }
    }
}

/// Draws the known obstacles around a robot at `robot` (map frame), and the direction that it steers for, rad from its heading.
pub fn draw_known<'a>(
    overlay: &mut Overlay,
    obstacles: impl Iterator<Item = &'a KnownObstacle>,
    robot: &Pose2,
    aim_rad: Option<f64>,
) {
    let robot_from_map = robot.inverse();
    let mut known = overlay.robot("known obstacles", RED);
    for obstacle in obstacles {
        let at: Point2<f64> = robot_from_map.transform_point(obstacle.at);
        known.circle(at.coords, obstacle.radius_m);
        if !obstacle.is_confirmed {
            known.text(at.coords, format_args!("?"));
        }
    }
    if let Some(aim_rad) = aim_rad {
        let (sin, cos) = aim_rad.sin_cos();
        overlay.robot("aim", MAGENTA).line(Vector2::zeros(), Vector2::new(AIM_M * cos, AIM_M * sin));
    }
}
