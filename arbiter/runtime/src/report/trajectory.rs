//! Plot of a run: walls, the track in the colors of the behaviors in control, halts and people.

use std::path::{Path, PathBuf};

use plotters::prelude::{BitMapBackend, Circle, IntoDrawingArea, PathElement, Rectangle};
use plotters::style::{Color, RGBColor, ShapeStyle};

use super::Trace;
use super::labels::{self, Labels};
use super::lettering::{Area, DrawResult, LETTER_HEIGHT_PX, Pixel, draw_text, text_width};
use super::trace::TracePoint;
use yamabico_drawing::palette;

/// Corner of a wall, map frame, m.
pub type Corner = [f64; 2];

/// Factor by which everything is drawn larger and then reduced, to smooth slanted lines. All sizes below are those of the
/// large drawing.
const OVERSAMPLING: i32 = 2;
/// Maximum width of the map, px.
const MAX_WIDTH_PX: f64 = 2400.0;
/// Maximum height of the map, px.
const MAX_HEIGHT_PX: f64 = 1800.0;
/// Maximum scale, px per m.
const MAX_SCALE: f64 = 300.0;
/// Minimum distance between the corners of a drawn track, px.
const STRIDE_PX: i32 = 8;
/// Maximum distance outside of the map at which a point is drawn, px.
const MAX_OUTSIDE_PX: f64 = 8000.0;
const MARGIN_PX: i32 = 112;
/// Margin around everything that is drawn, m.
const MARGIN_M: f64 = 0.3;
const LINE_PX: i32 = 52;
/// Half the side of the square of a halt.
const HALT_PX: i32 = 10;
/// Radius of the ring of a person.
const PERSON_PX: i32 = 26;

const INK: RGBColor = rgb(palette::INK);
const GRID: RGBColor = rgb(palette::GRID);
const WALL: RGBColor = rgb(palette::WALL);
const WHEELS: RGBColor = RGBColor(170, 170, 170);
const HALT: RGBColor = RGBColor(200, 30, 30);
const PERSON: RGBColor = RGBColor(235, 130, 20);
/// Colors of the behaviors in control, in the order of appearance.
const OWNERS: [RGBColor; 6] = [
    RGBColor(30, 90, 200),
    RGBColor(150, 60, 170),
    RGBColor(20, 140, 90),
    RGBColor(190, 160, 20),
    RGBColor(20, 160, 190),
    RGBColor(120, 80, 40),
];

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

/// Draws a run and writes the plot to a PNG file.
///
/// # Errors
/// The file cannot be written.
pub fn write_trajectory(path: &Path, trace: &Trace, walls: &[Vec<Corner>]) -> Result<(), PlotError> {
    let plot = draw_trajectory(trace, walls)?;
    let failed =
        |error: image::ImageError| PlotError::Writing { path: path.to_owned(), reason: error.to_string() };
    plot.save_with_format(path, image::ImageFormat::Png).map_err(failed)
}

/// Draws a run between `walls` (polylines): the true track in the colors of the behaviors in control, the odometry in gray (in
/// these colors if there is no truth), halts as red squares with their duration, people as orange rings with the smallest
/// distance. Labels do not overlap. Axes in m.
///
/// # Errors
/// The drawing library fails.
fn draw_trajectory(trace: &Trace, walls: &[Vec<Corner>]) -> Result<image::RgbImage, PlotError> {
    let odometry = trace.odometry();
    let map = Map::around(trace, &odometry, walls);
    let legend = legend(trace, &odometry);
    let size =
        (map.width_px() as u32, (map.height_px() + legend_rows(&legend, map.width_px()) * LINE_PX) as u32);
    let mut bytes = vec![255; size.0 as usize * size.1 as usize * 3];
    draw(&mut bytes, size, trace, &odometry, walls, &map, &legend)
        .map_err(|error| PlotError::Drawing(error.to_string()))?;
    let large = image::RgbImage::from_raw(size.0, size.1, bytes)
        .ok_or_else(|| PlotError::Drawing("the plot has no size".to_owned()))?;
    let (width, height) = (size.0 / OVERSAMPLING as u32, size.1 / OVERSAMPLING as u32);
    Ok(image::imageops::thumbnail(&large, width, height))
}

/// Conversion from meters to pixels.
struct Map {
    left_m: f64,
    right_m: f64,
    bottom_m: f64,
    top_m: f64,
    scale: f64,
}

impl Map {
    fn around(trace: &Trace, odometry: &[TracePoint], walls: &[Vec<Corner>]) -> Map {
        let tracks = trace.truth().iter().chain(odometry).map(|point| [point.pose.x, point.pose.y]);
        let corners = walls.iter().flatten().copied().chain(tracks);
        let mut bounds = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        for [x, y] in corners.filter(|corner| corner.iter().all(|value| value.is_finite())) {
            bounds = [bounds[0].min(x), bounds[1].max(x), bounds[2].min(y), bounds[3].max(y)];
        }
        if bounds[0] > bounds[1] {
            bounds = [-1.0, 1.0, -1.0, 1.0];
        }
        let [left_m, right_m] = [bounds[0] - MARGIN_M, bounds[1] + MARGIN_M];
        let [bottom_m, top_m] = [bounds[2] - MARGIN_M, bounds[3] + MARGIN_M];
        let scale =
            (MAX_WIDTH_PX / (right_m - left_m)).min(MAX_HEIGHT_PX / (top_m - bottom_m)).min(MAX_SCALE);
        Map { left_m, right_m, bottom_m, top_m, scale }
    }

    fn width_px(&self) -> i32 {
        (((self.right_m - self.left_m) * self.scale) as i32 + 2 * MARGIN_PX).max(960)
    }

    fn height_px(&self) -> i32 {
        ((self.top_m - self.bottom_m) * self.scale) as i32 + 2 * MARGIN_PX
    }

    fn pixel(&self, x: f64, y: f64) -> Pixel {
        let right = ((x - self.left_m) * self.scale).clamp(-MAX_OUTSIDE_PX, MAX_OUTSIDE_PX);
        let down = ((self.top_m - y) * self.scale).clamp(-MAX_OUTSIDE_PX, MAX_OUTSIDE_PX);
        (MARGIN_PX + right.round() as i32, MARGIN_PX + down.round() as i32)
    }
}

struct Legend {
    text: String,
    color: RGBColor,
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
    let (mut rows, mut x) = (1, MARGIN_PX);
    for entry in legend {
        if x + legend_width(entry) > max_width && x > MARGIN_PX {
            (rows, x) = (rows + 1, MARGIN_PX);
        }
        x += legend_width(entry);
    }
    rows
}

fn owner_color(owner: Option<usize>) -> RGBColor {
    owner.map_or(INK, |index| OWNERS[index % OWNERS.len()])
}

fn draw(
    bytes: &mut [u8],
    size: (u32, u32),
    trace: &Trace,
    odometry: &[TracePoint],
    walls: &[Vec<Corner>],
    map: &Map,
    legend: &[Legend],
) -> DrawResult {
    let area = BitMapBackend::with_buffer(bytes, size).into_drawing_area();
    draw_axes(&area, map)?;
    for wall in walls {
        let corners: Vec<_> = wall.iter().map(|&[x, y]| map.pixel(x, y)).collect();
        draw_line(&area, corners, WALL.stroke_width(7))?;
    }
    if trace.truth().is_empty() {
        draw_track(&area, map, odometry, 6)?;
    } else {
        draw_line(&area, path(map, odometry), WHEELS.stroke_width(4))?;
        draw_track(&area, map, trace.truth(), 6)?;
    }
    let mut labels = empty_labels(trace, odometry, walls, map);
    draw_marks(&area, map, trace, &mut labels)?;
    draw_legend(&area, map, legend)?;
    area.present()?;
    Ok(())
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

/// Draws halts and people, each with its label.
fn draw_marks(area: &Area<'_>, map: &Map, trace: &Trace, labels: &mut Labels) -> DrawResult {
    let people = trace.encounters().into_iter().map(|encounter| Mark {
        center: map.pixel(encounter.x, encounter.y),
        radius_px: PERSON_PX,
        text: format!("{:.2} m", encounter.nearest_m),
        color: PERSON,
    });
    let halts = trace.halts().into_iter().map(|halt| Mark {
        center: map.pixel(halt.pose.x, halt.pose.y),
        radius_px: HALT_PX,
        text: format!("{:.1} s", halt.halt.duration_s),
        color: HALT,
    });
    let marks: Vec<Mark> = people.chain(halts).collect();
    marks.iter().for_each(|mark| labels.add_mark(mark.rectangle()));
    for mark in &marks {
        let (x, y) = mark.center;
        if mark.color == PERSON {
            area.draw(&Circle::new(mark.center, PERSON_PX, PERSON.stroke_width(6)))?;
        } else {
            let corners = [(x - HALT_PX, y - HALT_PX), (x + HALT_PX, y + HALT_PX)];
            area.draw(&Rectangle::new(corners, HALT.filled()))?;
        }
        let label = labels.place(mark.rectangle(), text_width(&mark.text), LETTER_HEIGHT_PX);
        if label.is_remote {
            let near_y = if label.text.bottom < y { label.text.bottom + 4 } else { label.text.top - 4 };
            draw_line(area, vec![mark.center, (x, near_y)], mark.color.stroke_width(2))?;
        }
        draw_text(area, &mark.text, (label.text.left, label.text.top), mark.color)?;
    }
    Ok(())
}

/// Halt or person in the plot.
struct Mark {
    center: Pixel,
    radius_px: i32,
    text: String,
    color: RGBColor,
}

impl Mark {
    fn rectangle(&self) -> labels::Rectangle {
        labels::Rectangle::around(self.center, self.radius_px)
    }
}

fn draw_axes(area: &Area<'_>, map: &Map) -> DrawResult {
    let step = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1000.0];
    let step = step.into_iter().find(|step| step * map.scale >= 120.0).unwrap_or(10_000.0);
    let ticks = |low: f64, high: f64| {
        ((low / step).ceil() as i64..=(high / step).floor() as i64).map(move |i| i as f64 * step)
    };
    let (left, top) = map.pixel(map.left_m, map.top_m);
    let (right, bottom) = map.pixel(map.right_m, map.bottom_m);
    for x in ticks(map.left_m, map.right_m) {
        let at = map.pixel(x, 0.0).0;
        draw_line(area, vec![(at, top), (at, bottom)], GRID.stroke_width(2))?;
        let text = format!("{x}");
        draw_text(area, &text, (at - text_width(&text) / 2, bottom + 16), INK)?;
    }
    for y in ticks(map.bottom_m, map.top_m) {
        let at = map.pixel(0.0, y).1;
        draw_line(area, vec![(left, at), (right, at)], GRID.stroke_width(2))?;
        let text = format!("{y}");
        draw_text(area, &text, (left - text_width(&text) - 14, at - LETTER_HEIGHT_PX / 2), INK)?;
    }
    let frame = vec![(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
    draw_line(area, frame, INK.stroke_width(2))?;
    draw_text(area, "x (m)", (right - text_width("x (m)"), bottom + 60), INK)?;
    draw_text(area, "y (m)", (16, top - 52), INK)
}

/// Draws a track, each piece in the color of the behavior in control.
fn draw_track(area: &Area<'_>, map: &Map, points: &[TracePoint], thickness: u32) -> DrawResult {
    let mut begin = 0;
    for end in 1..=points.len() {
        if end == points.len() || points[end].owner != points[begin].owner {
            let piece = &points[begin..points.len().min(end + 1)];
            draw_line(area, path(map, piece), owner_color(points[begin].owner).stroke_width(thickness))?;
            begin = end;
        }
    }
    Ok(())
}

/// Pixels of a track, without those that are too close together to show a direction.
fn path(map: &Map, points: &[TracePoint]) -> Vec<Pixel> {
    let mut path: Vec<Pixel> = Vec::new();
    for (i, point) in points.iter().enumerate() {
        let (x, y) = map.pixel(point.pose.x, point.pose.y);
        let is_apart = |last: &Pixel| (x - last.0).abs() + (y - last.1).abs() >= STRIDE_PX;
        if i + 1 == points.len() || path.last().is_none_or(is_apart) {
            path.push((x, y));
        }
    }
    path
}

fn draw_legend(area: &Area<'_>, map: &Map, legend: &[Legend]) -> DrawResult {
    let (mut x, mut y) = (MARGIN_PX, map.height_px());
    for entry in legend {
        if x + legend_width(entry) > map.width_px() && x > MARGIN_PX {
            (x, y) = (MARGIN_PX, y + LINE_PX);
        }
        area.draw(&Rectangle::new([(x, y), (x + 40, y + 28)], entry.color.filled()))?;
        draw_text(area, &entry.text, (x + 56, y), INK)?;
        x += legend_width(entry);
    }
    Ok(())
}

fn draw_line(area: &Area<'_>, path: Vec<Pixel>, style: ShapeStyle) -> DrawResult {
    Ok(area.draw(&PathElement::new(path, style))?)
}

/// Converts a color for `plotters`.
const fn rgb([red, green, blue]: yamabico_drawing::Color) -> RGBColor {
    RGBColor(red, green, blue)
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

    fn count(plot: &image::RgbImage, color: RGBColor) -> usize {
        plot.pixels().filter(|pixel| pixel.0 == [color.0, color.1, color.2]).count()
    }

    #[test]
    fn track_walls_halts_and_people_are_drawn() {
        let (trace, walls) = hallway();
        let plot = draw_trajectory(&trace, &walls).unwrap();
        if let Some(folder) = std::env::var_os("YAMABICO_PICTURES") {
            plot.save(Path::new(&folder).join("trajectory.png")).unwrap();
        }
        // About 100 px per m, three wide.
        for (color, min) in
            [(OWNERS[0], 1500), (OWNERS[2], 500), (WALL, 4000), (WHEELS, 500), (HALT, 80), (PERSON, 80)]
        {
            assert!(count(&plot, color) >= min, "{color:?}: {}", count(&plot, color));
        }
        let map = Map::around(&trace, &[], &walls);
        let halt = map.pixel(trace.halts()[0].pose.x, trace.halts()[0].pose.y);
        assert_eq!(
            plot.get_pixel((halt.0 / OVERSAMPLING) as u32, (halt.1 / OVERSAMPLING) as u32).0,
            [HALT.0, HALT.1, HALT.2]
        );
    }

    #[test]
    fn left_is_up_and_an_empty_run_is_drawn_too() {
        let (_, walls) = hallway();
        let map = Map::around(&Trace::default(), &[], &walls);
        assert!(
            map.pixel(1.0, 1.0).1 < map.pixel(1.0, -1.0).1 && map.pixel(0.0, 0.0).0 < map.pixel(1.0, 0.0).0
        );
        assert!(draw_trajectory(&Trace::default(), &[]).unwrap().width() > 100);
        let hostile = vec![vec![[f64::NAN, 0.0], [f64::INFINITY, 1.0]]];
        assert!(draw_trajectory(&Trace::default(), &hostile).is_ok());
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        let error = write_trajectory(Path::new("/nowhere/at/all.png"), &Trace::default(), &[]).unwrap_err();
        assert!(error.to_string().contains("cannot write /nowhere/at/all.png"), "{error}");
    }
}
