//! Charts of a report as SVG: who had control, speeds, latencies, and the floor around the robot.

use yamabico_core::message::{MarkKind, OverlayMark};
use yamabico_core::overlay::{Space, layers};
use yamabico_core::time::Time;
use yamabico_drawing::palette::{GRID, INK};
use yamabico_drawing::{Color, font};

use super::figure::{Figure, LETTER_HEIGHT, Pixel, text_width};
use super::timeline::{BUCKET_MS, Holder, Span, Speeds};
use super::trajectory::HALT;

/// Width of a chart, units of the figure.
const WIDTH: i32 = 2200;
/// Width of the names left of a chart.
const LEFT: i32 = 260;
const RIGHT: i32 = 40;
/// Height of one strip.
const STRIP: i32 = 56;
/// Height of one plot of speeds.
const PLOT: i32 = 260;
const IDLE: Color = [235; 3];
/// Colors of wanted, allowed and commanded speeds.
const SPEEDS: [(&str, Color); 3] =
    [("wanted", [70, 150, 255]), ("allowed", [235, 150, 30]), ("commanded", [30, 30, 30])];

/// Speeds of one kind: wanted, allowed and commanded.
type Pick = fn(&Speeds) -> [f64; 3];

/// Time axis of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeAxis {
    first: Time,
    duration_s: f64,
}

impl TimeAxis {
    /// The axis from the first to the last message.
    pub fn new(first: Time, last: Time) -> TimeAxis {
        TimeAxis { first, duration_s: last.since(first).as_secs_f64().max(0.1) }
    }

    /// Time since the first message, s.
    pub fn seconds(&self, at: Time) -> f64 {
        at.seconds_after(self.first)
    }

    fn x(&self, at: Time) -> i32 {
        let share = (self.seconds(at) / self.duration_s).clamp(0.0, 1.0);
        LEFT + (share * f64::from(WIDTH - LEFT - RIGHT)).round() as i32
    }

    /// Draws lines and labels at round times, between two heights.
    fn draw(&self, figure: &mut Figure, top: i32, bottom: i32) {
        let steps = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0];
        let step = steps.into_iter().find(|step| self.duration_s / step <= 14.0).unwrap_or(7200.0);
        let ticks = (self.duration_s / step) as i64;
        for tick in 0..=ticks.min(200) {
            let seconds = tick as f64 * step;
            let share = seconds / self.duration_s;
            let x = LEFT + (share * f64::from(WIDTH - LEFT - RIGHT)).round() as i32;
            figure.line(vec![(x, top), (x, bottom)], 2, GRID);
            let text = if tick == ticks { format!("{seconds} s") } else { format!("{seconds}") };
            figure.text((x - text_width(&text) / 2, bottom + 12), text, INK);
        }
    }
}

/// Strips: who had control of each axis. `color` gives the color of a behavior.
pub(super) fn strips<'a>(
    axis: &TimeAxis,
    rows: impl Iterator<Item = (&'a str, &'a [Span])>,
    color: &dyn Fn(&str) -> Color,
) -> Figure {
    let rows: Vec<_> = rows.collect();
    let bottom = STRIP * rows.len() as i32;
    let mut figure = Figure::new(WIDTH, bottom + 60);
    axis.draw(&mut figure, 0, bottom);
    for (row, (name, spans)) in rows.iter().enumerate() {
        let top = STRIP * row as i32;
        figure.text((0, top + (STRIP - LETTER_HEIGHT) / 2), *name, INK);
        for span in *spans {
            let (left, right) = (axis.x(span.begin), axis.x(span.end));
            let color = match &span.holder {
                Holder::Behavior(name) => color(name),
                Holder::Halt(_) => HALT,
                Holder::NoBehavior => IDLE,
            };
            figure.rectangle((left, top + 6), ((right - left).max(2), STRIP - 12), color);
        }
    }
    figure
}

/// Speeds that were wanted, allowed and commanded: forward, and turning.
pub(super) fn speeds(axis: &TimeAxis, speeds: &[Speeds]) -> Figure {
    let mut figure = Figure::new(WIDTH, 2 * PLOT + 130);
    axis.draw(&mut figure, 0, 2 * PLOT);
    let plots: [(&str, Pick); 2] =
        [("forward, m/s", |speeds| speeds.linear), ("turn, rad/s", |speeds| speeds.angular)];
    for (row, (name, pick)) in plots.into_iter().enumerate() {
        let top = PLOT * row as i32;
        let values = || speeds.iter().flat_map(pick).filter(|value| value.is_finite());
        let high = values().fold(0.1, f64::max);
        let low = values().fold(if row == 0 { 0.0 } else { -0.1 }, f64::min);
        let y = |value: f64| {
            let share = (value.clamp(low, high) - low) / (high - low);
            top + PLOT - 20 - (share * f64::from(PLOT - 40)).round() as i32
        };
        figure.text((0, top + 20), name, INK);
        for value in [high, low].into_iter().filter(|value| value.abs() > 1e-9).chain([0.0]) {
            figure.line(vec![(LEFT, y(value)), (WIDTH - RIGHT, y(value))], 2, GRID);
            let text = format!("{value:.2}");
            figure.text((LEFT - text_width(&text) - 14, y(value) - LETTER_HEIGHT / 2), text, INK);
        }
        for (index, (_, color)) in SPEEDS.iter().enumerate() {
            let points = speeds.iter().filter(|at| pick(at)[index].is_finite());
            let points: Vec<Pixel> = points.map(|at| (axis.x(at.at), y(pick(at)[index]))).collect();
            figure.line(thinned(points), 3, *color);
        }
    }
    let mut x = LEFT;
    for (name, color) in SPEEDS {
        figure.rectangle((x, 2 * PLOT + 70), (40, 24), color);
        figure.text((x + 54, 2 * PLOT + 72), name, INK);
        x += text_width(name) + 120;
    }
    figure
}

/// Removes points in the middle of level lines.
fn thinned(points: Vec<Pixel>) -> Vec<Pixel> {
    let mut kept: Vec<Pixel> = Vec::new();
    for point in points {
        if let [.., before, last] = kept.as_slice()
            && before.1 == last.1
            && last.1 == point.1
        {
            kept.pop();
        }
        kept.push(point);
    }
    kept
}

/// Histogram of the latencies from capture to command; `None` if there are none.
pub(super) fn latencies(counts: &[u32]) -> Option<Figure> {
    let last = counts.iter().rposition(|count| *count > 0)?;
    // At most about forty bars.
    let merged = (last / 40 + 1).max(1);
    let bars: Vec<u64> =
        counts[..=last].chunks(merged).map(|part| part.iter().map(|&count| u64::from(count)).sum()).collect();
    let highest = bars.iter().copied().max().unwrap_or(1).max(1);
    let mut figure = Figure::new(WIDTH, PLOT + 120);
    let width = (WIDTH - LEFT - RIGHT) / (bars.len() as i32).max(10);
    figure.text((0, 20), "commands", INK);
    for (index, count) in bars.iter().enumerate() {
        let height = (*count as f64 / highest as f64 * f64::from(PLOT - 40)).ceil() as i32;
        let left = LEFT + width * index as i32;
        figure.rectangle((left, PLOT - height), ((width - 4).max(2), height), [70, 130, 200]);
    }
    figure.line(vec![(LEFT, PLOT), (WIDTH - RIGHT, PLOT)], 2, INK);
    let bar_ms = BUCKET_MS * merged as f64;
    let every = (bars.len() / 10).max(1);
    for index in (0..=bars.len()).step_by(every) {
        let text = format!("{:.0}", index as f64 * bar_ms);
        let x = LEFT + width * index as i32;
        figure.text((x - text_width(&text) / 2, PLOT + 14), text, INK);
    }
    figure.text((LEFT, PLOT + 60), "from capture to command, ms", INK);
    let most = format!("{highest}");
    figure.text((LEFT - text_width(&most) - 14, 34), most, INK);
    Some(figure)
}

/// The floor around the robot, forward up: the layers in the robot frame. `None` without any.
pub(super) fn from_above(overlays: &[(String, Vec<OverlayMark>)], radius_m: f64) -> Option<Figure> {
    const SIDE: i32 = 900;
    /// Distances that are shown to each side of the robot, and behind it, m.
    const REACH_M: [f64; 2] = [1.6, 0.7];
    let scale = f64::from(SIDE) / (2.0 * REACH_M[0]);
    let at = |x: f64, y: f64| {
        let units =
            |meters: f64| (meters * scale).clamp(-4.0 * f64::from(SIDE), 4.0 * f64::from(SIDE)) as i32;
        (SIDE / 2 - units(y), SIDE - units(REACH_M[1]) - units(x))
    };
    let mut figure = Figure::new(SIDE, SIDE);
    for meters in -3..=4 {
        let meters = f64::from(meters);
        figure.line(vec![at(-9.0, meters), at(9.0, meters)], 1, GRID);
        figure.line(vec![at(meters, -9.0), at(meters, 9.0)], 1, GRID);
    }
    let all =
        || overlays.iter().flat_map(|(_, marks)| layers(marks)).filter(|layer| layer.space == Space::Robot);
    for layer in all() {
        // Bright colors of pictures are too pale on white.
        let color = layer.color.map(|part| (f64::from(part) * 0.75) as u8);
        for mark in layer.marks {
            let from = at(mark.x, mark.y);
            let radius = |meters: f64| (meters.clamp(0.0, 9.0) * scale) as i32;
            match mark.kind() {
                Some(MarkKind::Line) => figure.line(vec![from, at(mark.x2, mark.y2)], 4, color),
                Some(MarkKind::Point) => figure.ring(from, 4, 4, color),
                Some(MarkKind::Circle) => figure.ring(from, radius(mark.x2), 4, color),
                Some(MarkKind::Text) => figure.text(from, mark.text.as_str(), color),
                _ => {}
            }
        }
    }
    let nose = at(radius_m, 0.0);
    figure.ring(at(0.0, 0.0), (radius_m.clamp(0.05, 2.0) * scale) as i32, 6, INK);
    figure.line(vec![at(0.0, 0.0), nose], 6, INK);
    let label = "grid 1 m, forward is up";
    figure.text((16, SIDE - 16 - (font::CAPITAL * 26.0) as i32), label, INK);
    all().next().is_some().then_some(figure)
}
