//! The navel grid on one image.

use clap::Args;
use nalgebra::Vector2;
use yamabico_core::image::{GrayImage, ImageView};
use yamabico_core::message::{FrameHeader, Proposal};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_drawing::{Canvas, Color};
use yamabico_free_space_avoider::navel_grid::PathObserver;
use yamabico_free_space_avoider::navel_grid::area_average::AreaAverage;
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider};
use yamabico_rigs::office;
use yamabico_sim::Renderer;
use yamabico_sim::random::stream;

use super::ImageFile;
use crate::arguments::Parameters;
use crate::images::{Output, load_gray, posterize};
use crate::report::{Report, Table, number};

/// Proposal of the free-space avoider's navel grid on one image of the office robot's camera.
///
/// Image: obstacle cells red, free cells green, cells of the path blue, other weighted cells light blue; a bar at the lower edge shows
/// speed (length) and turn rate (slant).
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    file: ImageFile,
    #[command(flatten)]
    parameters: Parameters,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let image = match &self.file.image {
            Some(path) => load_gray(path)?,
            None => {
                let mut renderer = Renderer::new(office::photometry(), stream(1, "noise"));
                let robot = self.file.at.or([3.3, 3.0, 170.0]);
                office::render(&mut renderer, &office::scene(), office::camera(340, 180), robot)?
            }
        };
        let (intrinsics, mount) = office::camera(image.width() as u32, image.height() as u32);
        let parameters = self.parameters.over("")?.to_string();
        let mut bench = Bench::<FreeSpaceAvoider>::new(&parameters, office::setup(intrinsics, mount))
            .map_err(|error| error.to_string())?;
        let stamp_ns = Time::from_secs_f64(1.0).0;
        let header = FrameHeader::gray(intrinsics.width, intrinsics.height, stamp_ns);
        let proposal = bench.at(1.0).feed(&CAMERA, &header, image.pixels()).propose();
        let observer = bench.behavior.navel_grid().ok_or("`method` must be \"navel-grid\"")?.observer();
        let view = image.view().map_err(|error| error.to_string())?;
        overlay(out, "navel_grid", view, observer, &proposal)?;
        let mut columns = Table::new("Cells of each column", &["column", "free", "path", "weighted"]);
        let (path, weighted) = observer.covered();
        for (column, &free) in observer.free().iter().enumerate() {
            columns.row([column.into(), free.into(), path[column].into(), weighted[column].into()]);
        }
        let mut directions = Table::new("Free distances", &["azimuth, deg", "distance, m"]);
        for direction in observer.directions() {
            directions.row([number(direction.azimuth_rad.to_degrees(), 0), number(direction.distance_m, 2)]);
        }
        Ok(Report::new([proposal_table(&proposal), columns, directions]))
    }
}

/// Returns a table with the proposal.
pub fn proposal_table(proposal: &Proposal) -> Table {
    let mut table =
        Table::new("Proposal", &["kind", "linear, m/s", "lateral, m/s", "angular, rad/s", "reason", "note"]);
    table.row([
        proposal.kind().map_or("?", |kind| kind.as_str()).into(),
        number(proposal.twist.linear, 2),
        number(proposal.twist.lateral, 2),
        number(proposal.twist.angular, 2),
        proposal.reason().map_or("", |reason| reason.as_str()).into(),
        proposal.note.as_str().into(),
    ]);
    table
}

/// Writes the image, twice as large, with the grid and the proposal.
pub fn overlay(
    out: &Output,
    name: &str,
    image: ImageView,
    observer: &PathObserver,
    proposal: &Proposal,
) -> Result<(), String> {
    let (width, height) = (2 * image.width(), 2 * image.height());
    let mut larger = GrayImage::new(width, height);
    AreaAverage::default().scale(image, &mut larger);
    posterize(larger.pixels_mut(), 17);
    let view = larger.view().map_err(|error| error.to_string())?;
    out.overlay(name, view, |canvas| draw(canvas, width as f64, height as f64, observer, proposal))
}

fn draw(canvas: &mut Canvas, width: f64, height: f64, observer: &PathObserver, proposal: &Proposal) {
    let size = observer.size();
    let (cell_u, cell_v) = (width / size.columns as f64, height / size.rows as f64);
    let (path, weighted) = observer.covered();
    let corner =
        |column: usize, row: usize| Vector2::new(column as f64 * cell_u, height - row as f64 * cell_v);
    let frame = |canvas: &mut Canvas, column: usize, row: usize, color: Color| {
        let margin = Vector2::new(2.0, -2.0);
        canvas.outline(corner(column, row) + margin, corner(column + 1, row + 1) - margin, color);
    };
    for column in 0..size.columns {
        let free = observer.free().get(column).map_or(0, |&free| free as usize);
        for row in 0..size.rows {
            if observer.cells().is_obstacle(column, row) {
                frame(canvas, column, row, [235, 60, 40]);
            } else if row < free {
                let color = match (row < path[column] as usize, row < weighted[column] as usize) {
                    (true, _) => [40, 120, 255],
                    (false, true) => [40, 200, 220],
                    (false, false) => [60, 170, 60],
                };
                frame(canvas, column, row, color);
            }
        }
        let end = corner(column, free);
        for line in 0..4 {
            let down = Vector2::new(0.0, f64::from(line));
            canvas.line(end + down, end + down + Vector2::new(cell_u, 0.0), [255, 220, 0]);
        }
    }
    let foot = Vector2::new(0.5 * width, height - 2.0);
    let head =
        foot - Vector2::new(0.6 * height * proposal.twist.angular, height * proposal.twist.linear.max(0.05));
    for side in -3..=3 {
        let shift = Vector2::new(f64::from(side), 0.0);
        canvas.line(foot + shift, head + shift, [255, 0, 255]);
    }
}
