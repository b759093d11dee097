//! The navel grid on one image.

use clap::Args;
use yamabico_core::message::{FrameHeader, Proposal};
use yamabico_core::testing::Bench;
use yamabico_core::time::Time;
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider};
use yamabico_rigs::office;
use yamabico_sim::Renderer;
use yamabico_sim::random::stream;

use super::ImageFile;
use crate::arguments::Parameters;
use crate::images::{Output, load_gray};
use crate::report::{Report, Table, number};

/// Proposal of the free-space avoider's navel grid on one image of the office robot's camera.
///
/// Image: obstacle cells red, free cells of the path blue, other free weighted cells light blue, number of free cells by column.
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
        let proposal = bench.draw().at(1.0).feed(&CAMERA, &header, image.pixels()).propose();
        let observer = bench.behavior.navel_grid().ok_or("`method` must be \"navel-grid\"")?.observer();
        let view = image.view().map_err(|error| error.to_string())?;
        out.layers("navel_grid", view, bench.overlay())?;
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
