//! Plot of a run: walls, the track in the colors of the behaviors in control, halts and people.

use std::path::{Path, PathBuf};

use super::Trace;
use super::figure::{Figure, LETTER_HEIGHT, Pixel, text_width};
use super::labels::{self, Labels};
use super::trace::TracePoint;
use yamabico_core::geometry::Pose2;
use yamabico_drawing::{Color, palette};
use yamabico_host::config::GoalArea;

/// Corner of a wall, map frame, m.
pub type Corner = [f64; 2];

/// Maximum width of the map. All sizes are in units of the figure, half a pixel each.
const MAX_WIDTH: f64 = 2400.0;
/// Maximum height of the map.
const MAX_HEIGHT: f64 = 1800.0;
/// Maximum scale, units per m.
const MAX_SCALE: f64 = 300.0;
/// Minimum distance between the corners of a drawn track.
const STRIDE: i32 = 8;
/// Maximum distance outside of the map at which a point is drawn.
const MAX_OUTSIDE: f64 = 8000.0;
const MARGIN: i32 = 112;
/// Margin around everything that is drawn, m.
const MARGIN_M: f64 = 0.3;
const LINE: i32 = 52;
/// Half the side of the square of a halt.
const HALT_SIZE: i32 = 10;
/// Radius of the ring of a person.
const PERSON_RADIUS: i32 = 26;

/// Radius of the ring of the start, and the smallest one of the goal.
const END: i32 = 14;

const INK: Color = palette::INK;
const GRID: Color = palette::GRID;
const WALL: Color = palette::WALL;
const WHEELS: Color = [170, 170, 170];
const PERSON: Color = [235, 130, 20];
const GOAL: Color = [20, 130, 60];
/// Color of a halt.
pub(super) const HALT: Color = [200, 30, 30];
/// Colors of the behaviors in control, in the order of appearance.
const OWNERS: [Color; 6] =
    [[30, 90, 200], [150, 60, 170], [20, 140, 90], [190, 160, 20], [20, 160, 190], [120, 80, 40]];

/// Failure to draw or write a plot.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// Drawing failed.
    #[error("cannot draw the trajectory: {0}")]
    Drawing(String),
    /// Writing failed.
    #[error("cannot write {}: {reason}; make the folder writable or choose another", path.display())]
    Writing {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
}

/// Draws a run and writes the plot to a PNG file, and to an SVG file beside it.
///
/// # Errors
/// A file cannot be written.
pub fn write_trajectory(
    path: &Path,
    trace: &Trace,
    walls: &[Vec<Corner>],
    goal: Option<&GoalArea>,
) -> Result<(), PlotError> {
    let plot = draw_trajectory(trace, walls, goal);
    let failed = |path: &Path, reason: String| PlotError::Writing { path: path.to_owned(), reason };
    let pixels = plot.pixels().ok_or_else(|| PlotError::Drawing("the plot has no size".to_owned()))?;
    pixels
        .save_with_format(path, image::ImageFormat::Png)
        .map_err(|error| failed(path, error.to_string()))?;
    let vectors = path.with_extension("svg");
    std::fs::write(&vectors, plot.svg()).map_err(|error| failed(&vectors, error.to_string()))
}

/// Draws a run between `walls` (polylines): the true track in the colors of the behaviors in control, the odometry in gray (in
/// these colors if there is no truth), start and goal as rings, halts as red squares with their duration, people as orange rings
/// with the smallest distance. Labels do not overlap. Axes in m.
pub fn draw_trajectory(trace: &Trace, walls: &[Vec<Corner>], goal: Option<&GoalArea>) -> Figure {
    let odometry = trace.odometry();
    let map = Map::around(trace, &odometry, walls, goal);
    let legend = legend(trace, &odometry);
    let height = map.height() + legend_rows(&legend, map.width()) * LINE;
    let mut figure = Figure::new(map.width(), height);
    draw_axes(&mut figure, &map);
    for wall in walls {
        figure.line(wall.iter().map(|&[x, y]| map.pixel(x, y)).collect(), 7, WALL);
    }
    if trace.truth().is_empty() {
        draw_track(&mut figure, &map, &odometry, 6);
    } else {
        figure.line(path(&map, &odometry), 4, WHEELS);
        draw_track(&mut figure, &map, trace.truth(), 6);
    }
    let mut labels = empty_labels(trace, &odometry, walls, &map);
    let start = trace.truth().first().or(odometry.first()).map(|point| point.pose);
    draw_marks(&mut figure, &marks(trace, &map, start, goal), &mut labels);
    draw_legend(&mut figure, &map, &legend);
    figure
}

/// Conversion from meters to units of the figure.
struct Map {
    left_m: f64,
    right_m: f64,
    bottom_m: f64,
    top_m: f64,
    scale: f64,
}

impl Map {
    fn around(trace: &Trace, odometry: &[TracePoint], walls: &[Vec<Corner>], goal: Option<&GoalArea>) -> Map {
        let tracks = trace.truth().iter().chain(odometry).map(|point| [point.pose.x, point.pose.y]);
        let goal = goal.map(|goal| [goal.x_m, goal.y_m]);
        let corners = walls.iter().flatten().copied().chain(tracks).chain(goal);
        let mut bounds = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        for [x, y] in corners.filter(|corner| corner.iter().all(|value| value.is_finite())) {
            bounds = [bounds[0].min(x), bounds[1].max(x), bounds[2].min(y), bounds[3].max(y)];
        }
        if bounds[0] > bounds[1] {
            bounds = [-1.0, 1.0, -1.0, 1.0];
        }
        let [left_m, right_m] = [bounds[0] - MARGIN_M, bounds[1] + MARGIN_M];
        let [bottom_m, top_m] = [bounds[2] - MARGIN_M, bounds[3] + MARGIN_M];
        let scale = (MAX_WIDTH / (right_m - left_m)).min(MAX_HEIGHT / (top_m - bottom_m)).min(MAX_SCALE);
        Map { left_m, right_m, bottom_m, top_m, scale }
    }

    fn width(&self) -> i32 {
        (((self.right_m - self.left_m) * self.scale) as i32 + 2 * MARGIN).max(960)
    }

    fn height(&self) -> i32 {
        ((self.top_m - self.bottom_m) * self.scale) as i32 + 2 * MARGIN
    }

    fn pixel(&self, x: f64, y: f64) -> Pixel {
        let right = ((x - self.left_m) * self.scale).clamp(-MAX_OUTSIDE, MAX_OUTSIDE);
        let down = ((self.top_m - y) * self.scale).clamp(-MAX_OUTSIDE, MAX_OUTSIDE);
        (MARGIN + right.round() as i32, MARGIN + down.round() as i32)
    }
}

struct Legend {
    text: String,
    color: Color,
}

fn legend(trace: &Trace, odometry: &[TracePoint]) -> Vec<Legend> {
    let owner =
        |(index, name): (usize, &String)| Legend { text: name.clone(), color: owner_color(Some(index)) };
    let mut legend: Vec<_> = trace.owners().iter().enumerate().map(owner).collect();
    let track = if trace.truth().is_empty() { odometry } else { trace.truth() };
    if track.iter().any(|point| point.owner.is_none()) {
        legend.push(Legend { text: "no behavior".into(), color: INK });
    }
    if !trace.truth().is_empty() {
        legend.push(Legend { text: "odometry".into(), color: WHEELS });
    }
    if !trace.halts().is_empty() {
        legend.push(Legend { text: "halt: duration".into(), color: HALT });
    }
    if !trace.encounters().is_empty() {
        legend.push(Legend { text: "person: nearest distance".into(), color: PERSON });
    }
    legend
}

fn legend_width(entry: &Legend) -> i32 {
    text_width(&entry.text) + 124
}

fn legend_rows(legend: &[Legend], max_width: i32) -> i32 {
    let (mut rows, mut x) = (1, MARGIN);
    for entry in legend {
        if x + legend_width(entry) > max_width && x > MARGIN {
            (rows, x) = (rows + 1, MARGIN);
        }
        x += legend_width(entry);
    }
    rows
}

/// Color of a behavior in control, by its index in [`Trace::owners`].
pub(super) fn owner_color(owner: Option<usize>) -> Color {
    owner.map_or(INK, |index| OWNERS[index % OWNERS.len()])
}

/// Returns a plot without labels, with the walls and tracks that labels avoid.
fn empty_labels(trace: &Trace, odometry: &[TracePoint], walls: &[Vec<Corner>], map: &Map) -> Labels {
    let ((left, top), (right, bottom)) =
        (map.pixel(map.left_m, map.top_m), map.pixel(map.right_m, map.bottom_m));
    let mut labels = Labels::new(labels::Rectangle { left, top, right, bottom });
    let walls = walls.iter().map(|wall| wall.iter().map(|&[x, y]| map.pixel(x, y)).collect());
    let lines: Vec<Vec<Pixel>> = walls.chain([path(map, odometry), path(map, trace.truth())]).collect();
    for ends in lines.iter().flat_map(|line| line.windows(2)) {
        labels.add_line(ends[0], ends[1]);
    }
    labels
}

/// Marks of the plot, in the order in which labels find their places.
fn marks(trace: &Trace, map: &Map, start: Option<Pose2>, goal: Option<&GoalArea>) -> Vec<Mark> {
    let ring = |x: f64, y: f64, radius: i32, text: String, color: Color| Mark {
        center: map.pixel(x, y),
        radius,
        text,
        color,
        is_square: false,
    };
    let goal = goal.map(|goal| {
        let radius = ((goal.tolerance_m * map.scale) as i32).clamp(END, 200);
        ring(goal.x_m, goal.y_m, radius, "goal".into(), GOAL)
    });
    let start = start.map(|start| ring(start.x, start.y, END, "start".into(), INK));
    let people = trace.encounters().into_iter().map(|encounter| {
        ring(encounter.x, encounter.y, PERSON_RADIUS, format!("{:.2} m", encounter.nearest_m), PERSON)
    });
    let halts = trace.halts().into_iter().map(|halt| Mark {
        is_square: true,
        ..ring(halt.pose.x, halt.pose.y, HALT_SIZE, format!("{:.1} s", halt.halt.duration_s), HALT)
    });
    start.into_iter().chain(goal).chain(people).chain(halts).collect()
}

/// Draws marks, each with its label.
fn draw_marks(figure: &mut Figure, marks: &[Mark], labels: &mut Labels) {
    marks.iter().for_each(|mark| labels.add_mark(mark.rectangle()));
    for mark in marks {
        let (x, y) = mark.center;
        if mark.is_square {
            figure.rectangle(
                (x - mark.radius, y - mark.radius),
                (2 * mark.radius, 2 * mark.radius),
                mark.color,
            );
        } else {
            figure.ring(mark.center, mark.radius, 6, mark.color);
        }
        let label = labels.place(mark.rectangle(), text_width(&mark.text), LETTER_HEIGHT);
        if label.is_remote {
            let near_y = if label.text.bottom < y { label.text.bottom + 4 } else { label.text.top - 4 };
            figure.line(vec![mark.center, (x, near_y)], 2, mark.color);
        }
        figure.text((label.text.left, label.text.top), mark.text.as_str(), mark.color);
    }
}

/// Start, goal, halt or person in the plot.
struct Mark {
    center: Pixel,
    radius: i32,
    text: String,
    color: Color,
    is_square: bool,
}

impl Mark {
    fn rectangle(&self) -> labels::Rectangle {
        labels::Rectangle::around(self.center, self.radius)
    }
}

fn draw_axes(figure: &mut Figure, map: &Map) {
    let step = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1000.0];
    let step = step.into_iter().find(|step| step * map.scale >= 120.0).unwrap_or(10_000.0);
    let ticks = |low: f64, high: f64| {
        ((low / step).ceil() as i64..=(high / step).floor() as i64).map(move |i| i as f64 * step)
    };
    let (left, top) = map.pixel(map.left_m, map.top_m);
    let (right, bottom) = map.pixel(map.right_m, map.bottom_m);
    for x in ticks(map.left_m, map.right_m) {
        let at = map.pixel(x, 0.0).0;
        figure.line(vec![(at, top), (at, bottom)], 2, GRID);
        let text = format!("{x}");
        figure.text((at - text_width(&text) / 2, bottom + 16), text, INK);
    }
    for y in ticks(map.bottom_m, map.top_m) {
        let at = map.pixel(0.0, y).1;
        figure.line(vec![(left, at), (right, at)], 2, GRID);
        let text = format!("{y}");
        figure.text((left - text_width(&text) - 14, at - LETTER_HEIGHT / 2), text, INK);
    }
    let frame = vec![(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
    figure.line(frame, 2, INK);
    figure.text((right - text_width("x (m)"), bottom + 60), "x (m)", INK);
    figure.text((16, top - 52), "y (m)", INK);
}

/// Draws a track, each piece in the color of the behavior in control.
fn draw_track(figure: &mut Figure, map: &Map, points: &[TracePoint], thickness: i32) {
    let mut begin = 0;
    for end in 1..=points.len() {
        if end == points.len() || points[end].owner != points[begin].owner {
            let piece = &points[begin..points.len().min(end + 1)];
            figure.line(path(map, piece), thickness, owner_color(points[begin].owner));
            begin = end;
        }
    }
}

/// Pixels of a track, without those that are too close together to show a direction.
fn path(map: &Map, points: &[TracePoint]) -> Vec<Pixel> {
    let mut path: Vec<Pixel> = Vec::new();
    for (i, point) in points.iter().enumerate() {
        let (x, y) = map.pixel(point.pose.x, point.pose.y);
        let is_apart = |last: &Pixel| (x - last.0).abs() + (y - last.1).abs() >= STRIDE;
        if i + 1 == points.len() || path.last().is_none_or(is_apart) {
            path.push((x, y));
        }
    }
    path
}

fn draw_legend(figure: &mut Figure, map: &Map, legend: &[Legend]) {
    let (mut x, mut y) = (MARGIN, map.height());
    for entry in legend {
        if x + legend_width(entry) > map.width() && x > MARGIN {
            (x, y) = (MARGIN, y + LINE);
        }
        figure.rectangle((x, y), (40, 28), entry.color);
        figure.text((x + 56, y), &entry.text, INK);
        x += legend_width(entry);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Tap;
    use yamabico_core::message::{
        Axes, DecisionHeader, Kind, Message, MessageType, Mode, Name, Odometry, Outcome, Truth, Verdict,
    };
    use yamabico_core::time::Time;

    fn send<M: Message>(trace: &mut Trace, header: &M, items: &[M::Item]) {
        let (header, items) = (bytemuck::bytes_of(header), bytemuck::cast_slice(items));
        trace.message("t", &MessageType::of::<M>(), Time::ZERO, header, items);
    }

    /// A hallway in which one behavior hands over to another, and a person makes the robot halt.
    fn hallway() -> (Trace, Vec<Vec<Corner>>) {
        let mut trace = Trace::default();
        let mut x = 0.5_f64;
        for step in 0..1600_u64 {
            let stamp_ns = step * 20_000_000;
            let halted = (600..760).contains(&step);
            x += if halted { 0.0 } else { 0.008 };
            let y = 0.15 * (-x / 2.0).exp();
            let person_m = if halted { 0.4 } else { f64::INFINITY };
            let vx = if halted { 0.0 } else { 0.4 };
            send(&mut trace, &Truth { stamp_ns, x, y, vx, person_m, ..Truth::default() }, &[]);
            let odometry = Odometry { stamp_ns, x: x - 0.5, y: 0.012 * (x - 0.5), ..Odometry::default() };
            send(&mut trace, &odometry, &[]);
            let name = if step < 1200 { "wall-follower" } else { "free-space" };
            let mode = if halted { Mode::Halted } else { Mode::Driving };
            let verdicts = [(name, Outcome::Won, Kind::Drive), ("sonar-halt", Outcome::Halting, Kind::Halt)];
            let verdicts = verdicts.map(|(name, outcome, kind)| Verdict {
                behavior: Name::new(name),
                outcome: outcome.code(),
                kind: kind.code(),
                ..Verdict::default()
            });
            let halted = if halted { Axes::ALL } else { Axes::NONE };
            let decision = DecisionHeader { stamp_ns, mode: mode.code(), halted, ..Default::default() };
            send(&mut trace, &decision, if halted.is_empty() { &verdicts[..1] } else { &verdicts });
        }
        let walls = vec![vec![[0.0, 1.0], [12.5, 1.0], [12.5, -1.0], [0.0, -1.0], [0.0, 1.0]]];
        (trace, walls)
    }

    const GOAL_AREA: GoalArea = GoalArea { x_m: 12.0, y_m: 0.0, tolerance_m: 0.3 };

    fn count(plot: &image::RgbImage, color: Color) -> usize {
        plot.pixels().filter(|pixel| pixel.0 == color).count()
    }

    #[test]
    fn track_walls_halts_and_people_are_drawn() {
        let (trace, walls) = hallway();
        let plot = draw_trajectory(&trace, &walls, Some(&GOAL_AREA)).pixels().unwrap();
        if let Some(folder) = std::env::var_os("YAMABICO_PICTURES") {
            plot.save(Path::new(&folder).join("trajectory.png")).unwrap();
        }
        // About 100 px per m, three wide.
        for (color, min) in
            [(OWNERS[0], 1500), (OWNERS[2], 500), (WALL, 4000), (WHEELS, 500), (HALT, 80), (PERSON, 80)]
        {
            assert!(count(&plot, color) >= min, "{color:?}: {}", count(&plot, color));
        }
        let map = Map::around(&trace, &[], &walls, Some(&GOAL_AREA));
        let halt = map.pixel(trace.halts()[0].pose.x, trace.halts()[0].pose.y);
        assert_eq!(plot.get_pixel((halt.0 / 2) as u32, (halt.1 / 2) as u32).0, HALT);
    }

    #[test]
    fn left_is_up_and_an_empty_run_is_drawn_too() {
        let (_, walls) = hallway();
        let map = Map::around(&Trace::default(), &[], &walls, None);
        assert!(
            map.pixel(1.0, 1.0).1 < map.pixel(1.0, -1.0).1 && map.pixel(0.0, 0.0).0 < map.pixel(1.0, 0.0).0
        );
        assert!(draw_trajectory(&Trace::default(), &[], None).pixels().unwrap().width() > 100);
        let hostile = vec![vec![[f64::NAN, 0.0], [f64::INFINITY, 1.0]]];
        assert!(draw_trajectory(&Trace::default(), &hostile, None).pixels().is_some());
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        let error =
            write_trajectory(Path::new("/nowhere/at/all.png"), &Trace::default(), &[], None).unwrap_err();
        assert!(error.to_string().contains("cannot write /nowhere/at/all.png"), "{error}");
    }
}
