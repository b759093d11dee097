//! The polar cells on one image of a mirror camera.

use clap::Args;
use image::RgbImage;
use yamabico_core::message::{Axes, Odometry, Proposal};
use yamabico_core::testing::Bench;
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider, ODOMETRY};
use yamabico_rigs::field;

use super::ImageFile;
use super::navel_grid::proposal_table;
use crate::arguments::Parameters;
use crate::images::{Output, load_rgb};
use crate::report::{Report, Table, number};

/// Proposal of the free-space avoider's polar cells on one image of the small field's mirror camera, 256 x 220 pixels.
///
/// Image: free cells green, the first blocked cell of each direction red.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    file: ImageFile,
    #[command(flatten)]
    parameters: Parameters,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let [width, height] = field::SIZE;
        let pixels = match &self.file.image {
            Some(path) => {
                let rgb = load_rgb(path)?;
                if rgb.dimensions() != (width, height) {
                    let size = rgb.dimensions();
                    return Err(format!(
                        "{}: needs {width} x {height} pixels, but has {size:?}",
                        path.display()
                    ));
                }
                rgb.into_raw()
            }
            None => {
                let robot = self.file.at.or([-0.75, 0.0, 0.0]);
                field::render(&mut field::renderer(field::camera()), &field::scene(), robot)
            }
        };
        let parameters = self.parameters.over(field::CONFIG)?.to_string();
        let mut bench = Bench::<FreeSpaceAvoider>::new(&parameters, field::setup(field::camera(), Axes::ALL))
            .map_err(|error| error.to_string())?;
        let mut proposal = Proposal::default();
        bench.draw();
        // A cell becomes free after two images.
        for seconds in [0.96, 1.0] {
            let header = field::frame_header(seconds);
            let odometry = Odometry { stamp_ns: header.stamp_ns, ..Odometry::default() };
            bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &header, &pixels);
            proposal = bench.propose();
        }
        let observer = bench.behavior.polar_cells().ok_or("`method` must be \"polar-cells\"")?.observer();
        let picture = RgbImage::from_raw(width, height, pixels).ok_or("an image without pixels")?;
        out.rgb_layers("polar_cells", picture, bench.overlay())?;
        let mut directions = Table::new(
            format!("Free rings and distances (floor colors {:?})", observer.colors()),
            &["azimuth, deg", "free rings", "distance, m"],
        );
        for (end, &free) in observer.distances().ends().zip(observer.free().rings()) {
            directions.row([number(end.azimuth_rad.to_degrees(), 0), free.into(), number(end.distance_m, 2)]);
        }
        Ok(Report::new([proposal_table(&proposal), directions]))
    }
}
