//! Plot of the trajectories of several settings: a map for each, and the commanded acceleration below.

use nalgebra::Vector2;
use plotters::coord::Shift;
use plotters::prelude::{BitMapBackend, Circle, DrawingArea, IntoDrawingArea, PathElement};
use plotters::style::{Color, RGBColor, ShapeStyle, WHITE};
use yamabico_drawing::font::pixels;
use yamabico_drawing::palette;

use super::trajectory::Trajectory;

/// Trajectories with one setting.
pub struct Setting {
    /// Name in the plot.
    pub name: String,
    /// One trajectory for each seed.
    pub trajectories: Vec<Trajectory>,
}

type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;
type DrawResult = Result<(), Box<dyn std::error::Error>>;

/// Factor by which the plot is drawn larger and then reduced, for smooth lines. Sizes below are those before the reduction.
const OVERSAMPLING: u32 = 2;
const PANEL_PX: f64 = 800.0;
const MARGIN_PX: f64 = 60.0;
const TEXT_PX: f64 = 30.0;
/// Height of the curves, px.
const CURVE_PX: f64 = 220.0;
/// Maximum of the curves, m/s^2.
const CURVE_MPS2: f64 = 0.4;
/// Time between two rings along a trajectory, s.
const RING_S: f64 = 0.5;

const INK: RGBColor = rgb(palette::INK);
const GRID: RGBColor = rgb(palette::GRID);
const WALL: RGBColor = rgb(palette::WALL);
const COLORS: [(RGBColor, RGBColor); 3] = [
    (RGBColor(30, 90, 200), RGBColor(190, 210, 245)),
    (RGBColor(200, 70, 30), RGBColor(250, 210, 190)),
    (RGBColor(20, 140, 90), RGBColor(185, 230, 210)),
];

/// Draws a map for each setting with the trajectory of the first seed dark, the others pale and a ring each half second; below, the
/// magnitude of the commanded acceleration of the first seed over time.
///
/// # Errors
/// If drawing fails, or a setting has no trajectory.
pub fn draw(
    settings: &[Setting],
    walls: &[Vec<[f64; 2]>],
) -> Result<image::RgbImage, Box<dyn std::error::Error>> {
    let map = Map::around(walls);
    let wide = settings.len() as f64 * (PANEL_PX + MARGIN_PX) + MARGIN_PX;
    let high = map.height_px + CURVE_PX + 4.0 * MARGIN_PX;
    let size = (wide as u32, high as u32);
    let mut bytes = vec![255; 3 * size.0 as usize * size.1 as usize];
    {
        let area = BitMapBackend::with_buffer(&mut bytes, size).into_drawing_area();
        area.fill(&WHITE)?;
        for (k, (setting, colors)) in settings.iter().zip(COLORS).enumerate() {
            let left = MARGIN_PX + k as f64 * (PANEL_PX + MARGIN_PX);
            panel(&area, &map, walls, setting, colors, left)?;
        }
        area.present()?;
    }
    let large = image::RgbImage::from_raw(size.0, size.1, bytes).ok_or("a plot without pixels")?;
    Ok(image::imageops::thumbnail(&large, size.0 / OVERSAMPLING, size.1 / OVERSAMPLING))
}

/// Transform from meters to the pixels of a panel.
struct Map {
    left_m: f64,
    top_m: f64,
    scale: f64,
    height_px: f64,
}

impl Map {
    fn around(walls: &[Vec<[f64; 2]>]) -> Self {
        let mut bounds = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        for [x, y] in walls.iter().flatten() {
            bounds = [bounds[0].min(*x), bounds[1].max(*x), bounds[2].min(*y), bounds[3].max(*y)];
        }
        let [left_m, right_m, bottom_m, top_m] =
            if bounds[0] < bounds[1] { bounds } else { [-1.0, 1.0, -1.0, 1.0] };
        let scale = PANEL_PX / (right_m - left_m);
        Self { left_m, top_m, scale, height_px: scale * (top_m - bottom_m) }
    }

    fn pixel(&self, left_px: f64, at: Vector2<f64>) -> (i32, i32) {
        let right = left_px + (at.x - self.left_m) * self.scale;
        let down = 2.0 * MARGIN_PX + (self.top_m - at.y) * self.scale;
        (right.round() as i32, down.round() as i32)
    }
}

fn panel(
    area: &Area<'_>,
    map: &Map,
    walls: &[Vec<[f64; 2]>],
    setting: &Setting,
    (dark, pale): (RGBColor, RGBColor),
    left: f64,
) -> DrawResult {
    text(area, &setting.name, (left as i32, MARGIN_PX as i32 / 2), dark)?;
    let line = |corners: Vec<(i32, i32)>, style: ShapeStyle| area.draw(&PathElement::new(corners, style));
    let path = |trajectory: &Trajectory| -> Vec<_> {
        trajectory.moments.iter().map(|moment| map.pixel(left, moment.at_m)).collect()
    };
    for other in setting.trajectories.iter().skip(1) {
        line(path(other), pale.stroke_width(2))?;
    }
    for wall in walls {
        let corners = wall.iter().map(|&[x, y]| map.pixel(left, Vector2::new(x, y))).collect();
        line(corners, WALL.stroke_width(4))?;
    }
    let first = setting.trajectories.first().ok_or("a setting without trajectory")?;
    line(path(first), dark.stroke_width(4))?;
    let mut next_s = 0.0;
    for moment in &first.moments {
        if moment.time_s >= next_s {
            area.draw(&Circle::new(map.pixel(left, moment.at_m), 7, dark.stroke_width(3)))?;
            next_s += RING_S;
        }
    }
    curve(area, first, dark, (left, 3.0 * MARGIN_PX + map.height_px))
}

/// Draws the magnitude of the commanded acceleration over time.
fn curve(area: &Area<'_>, trajectory: &Trajectory, dark: RGBColor, (left, top): (f64, f64)) -> DrawResult {
    let duration_s = 10.0;
    let pixel = |time_s: f64, value: f64| {
        let right = left + PANEL_PX * time_s / duration_s;
        let down = top + CURVE_PX * (1.0 - value / CURVE_MPS2);
        (right.round() as i32, down.round() as i32)
    };
    let line = |corners: Vec<(i32, i32)>, style: ShapeStyle| area.draw(&PathElement::new(corners, style));
    for tenths in [0, 1, 2, 3, 4] {
        let value = 0.1 * f64::from(tenths);
        line(vec![pixel(0.0, value), pixel(duration_s, value)], GRID.stroke_width(2))?;
    }
    for seconds in 0..=10 {
        let at = f64::from(seconds);
        line(vec![pixel(at, 0.0), pixel(at, CURVE_MPS2)], GRID.stroke_width(2))?;
        let (x, y) = pixel(at, 0.0);
        text(area, &seconds.to_string(), (x - 8, y + 12), INK)?;
    }
    let corners =
        trajectory.accelerations.iter().map(|&(time_s, value)| pixel(time_s, value.min(CURVE_MPS2)));
    line(corners.collect(), dark.stroke_width(3))?;
    let (x, y) = pixel(0.0, CURVE_MPS2);
    text(area, "commanded acceleration, m/s^2, over time, s", (x, y - 36), INK)
}

fn text(area: &Area<'_>, label: &str, (x, y): (i32, i32), color: RGBColor) -> DrawResult {
    let mut drawn = Ok(());
    pixels(label, TEXT_PX, [f64::from(x), f64::from(y)], |u, v, coverage| {
        let result = area.draw_pixel((u, v), &color.mix(coverage));
        if drawn.is_ok() {
            drawn = result;
        }
    });
    Ok(drawn?)
}

/// Converts a color for `plotters`.
const fn rgb([red, green, blue]: yamabico_drawing::Color) -> RGBColor {
    RGBColor(red, green, blue)
}
