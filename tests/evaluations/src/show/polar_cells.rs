//! The polar cells on one image of a mirror camera.

use clap::Args;
use nalgebra::Vector2;
use yamabico_core::message::{Axes, Odometry, Proposal};
use yamabico_core::testing::Bench;
use yamabico_drawing::{Canvas, Color};
use yamabico_free_space_avoider::polar_cells::RingObserver;
use yamabico_free_space_avoider::{CAMERA, FreeSpaceAvoider, ODOMETRY};
use yamabico_rigs::field;

use super::ImageFile;
use super::navel_grid::proposal_table;
use crate::arguments::Parameters;
use crate::images::{Output, load_rgb, posterize};
use crate::report::{Report, Table, number};

const SCALE: usize = 2;

/// Proposal of the free-space avoider's polar cells on one image of the small field's mirror camera, 256 x 220 pixels.
///
/// Image: free cells green, the first blocked cell of each direction red, the velocity magenta with the length of one second.
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
        // A cell becomes free after two images.
        for seconds in [0.96, 1.0] {
            let header = field::frame_header(seconds);
            let odometry = Odometry { stamp_ns: header.stamp_ns, ..Odometry::default() };
            bench.at(seconds).feed(&ODOMETRY, &odometry, &[]).feed(&CAMERA, &header, &pixels);
            bench.propose();
        }
        let proposal = bench.propose();
        let observer = bench.behavior.polar_cells().ok_or("`method` must be \"polar-cells\"")?.observer();
        if out.is_on() {
            draw(out, &pixels, observer, &proposal)?;
        }
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

fn draw(out: &Output, pixels: &[u8], observer: &RingObserver, proposal: &Proposal) -> Result<(), String> {
    let camera = field::camera();
    let image = camera.image();
    let [columns, rows] = image.size().map(|size| size as usize);
    let (width, height) = (SCALE * columns, SCALE * rows);
    let mut data = Vec::with_capacity(3 * width * height);
    for v in 0..height {
        for u in 0..width {
            data.extend(&pixels[3 * (v / SCALE * columns + u / SCALE)..][..3]);
        }
    }
    posterize(&mut data, 20);
    let mut canvas = Canvas::new(&mut data, width, height).ok_or("an image without pixels")?;
    let at = |radius_px: f64, azimuth: f64| {
        let half = Vector2::repeat(0.5 * (SCALE as f64 - 1.0));
        image.pixel_from_polar(radius_px, azimuth) * SCALE as f64 + half
    };
    let distances = observer.distances();
    let cell = |canvas: &mut Canvas, ring: usize, sector: usize, color: Color| {
        let (right, left) = distances.borders(sector);
        let (right, left) = (right + 0.015, left - 0.015);
        let (inner, outer) = (observer.edges_px()[ring] + 0.7, observer.edges_px()[ring + 1] - 0.7);
        let corners = [(inner, right), (outer, right), (outer, left), (inner, left), (inner, right)];
        for pair in corners.windows(2) {
            canvas.line(at(pair[0].0, pair[0].1), at(pair[1].0, pair[1].1), color);
        }
    };
    for (sector, &free) in observer.free().rings().iter().enumerate() {
        for ring in 0..free {
            cell(&mut canvas, ring, sector, [70, 230, 90]);
        }
        if free + 1 < observer.edges_px().len() {
            cell(&mut canvas, free, sector, [255, 50, 30]);
        }
    }
    let velocity = Vector2::new(proposal.twist.linear, proposal.twist.lateral);
    if velocity.norm() > 0.0 {
        let azimuth = velocity.y.atan2(velocity.x);
        let reach = observer.edges_m().iter().filter(|&&edge| edge <= velocity.norm()).count();
        let radius_px = observer.edges_px()[reach.clamp(1, observer.edges_px().len() - 1)];
        let across = Vector2::new(-azimuth.sin(), azimuth.cos());
        for side in -4..=4 {
            let shift = image.pixel_from_mirror(across * (0.3 * f64::from(side))) - image.center();
            canvas.line(at(4.0, azimuth) + shift * 3.0, at(radius_px, azimuth) + shift * 3.0, [255, 0, 255]);
        }
    }
    out.rgb("polar_cells", &data, width as u32, height as u32)
}
