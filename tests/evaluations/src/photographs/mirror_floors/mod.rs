//! Polar cells and a calibrated mirror on photographs of a soccer field.

mod lines;

use std::f64::consts::TAU;
use std::path::Path;

use clap::Args;
use nalgebra::Vector2;
use serde_json::Value;
use yamabico_core::camera::{Mirror, MirrorCamera, MirrorImage, Mount, RadialModel, RadialProfile};
use yamabico_core::image::RgbView;
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::polar_cells::RingObserver;
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::floor_training::{FloorTraining, Label};

use crate::arguments::{Data, Parameters};
use crate::images::load_rgb;
use crate::report::{Report, Table, number};

/// End of the floor in each direction; the file's header says how it was labeled.
const LABELS: &str = include_str!("labels.txt");
/// Parameters of the behavior. At 8.5 m a pixel covers half a meter.
const CONFIG: &str =
    "method = 'polar-cells'\nrings = 24\nmax_range_m = 8.5\nclosing_px = 3\ncolor_tolerance = 40\n";
/// Height of the viewpoint, m: arbitrary, since the mirrors were calibrated on the floor.
const HEIGHT_M: f64 = 0.6;
/// Distance from a label within which a pixel is not used for training, px.
const UNCERTAIN_PX: f64 = 4.0;
/// Radius of the robots, m.
const RADIUS_M: f64 = 0.42;

/// Polar cells and a calibrated mirror on photographs of a soccer field through mirrors (`omni_msl/`).
///
/// Cells: free cells from the robot outwards against labels in 32 directions, first with the floor colors of each image's own innermost
/// ring ahead, then with a table learned from every other direction of the image and tested in the directions between. Lines: pixels
/// of field lines labeled by others, projected onto the floor by the mirror model and moved to the best fit with the map of the field.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    data: Data,
    #[command(flatten)]
    parameters: Parameters,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let Some(folder) = self.data.set("omni_msl") else { return Ok(Report::default()) };
        let path = folder.join("calibration.json");
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let calibration: Value =
            serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
        let config: Config = self.parameters.over(CONFIG)?.try_into().map_err(|error| format!("{error}"))?;
        let photographs: Vec<Photograph> = LABELS
            .lines()
            .filter(|line| !line.starts_with('#'))
            .map(|line| Photograph::read(&folder, &calibration, line))
            .collect::<Result<_, _>>()?;
        let mut table = Table::new(
            "Free cells",
            &[
                "image",
                "floor colors",
                "detected",
                "labeled",
                "both",
                "precision",
                "recall",
                "directions",
                "same ring",
                "within one ring",
            ],
        );
        for (colors, is_learned) in [("innermost ring ahead", false), ("every other direction", true)] {
            let mut all = Score::default();
            for photograph in &photographs {
                let score = photograph.evaluate(&config, is_learned.then(|| photograph.learn()))?;
                score.row(&mut table, &photograph.name, colors);
                all.add(&score);
            }
            all.row(&mut table, "all", colors);
        }
        Ok(Report::new([table, lines::residual(&folder, &calibration)?]))
    }
}

/// Cells that are free from the robot outwards.
#[derive(Default)]
struct Score {
    detected: usize,
    labeled: usize,
    both: usize,
    directions: usize,
    /// Directions whose free cells end in the labeled ring.
    same: usize,
    /// Directions whose free cells end within one ring of the labeled one.
    near: usize,
}

impl Score {
    fn add(&mut self, other: &Score) {
        self.detected += other.detected;
        self.labeled += other.labeled;
        self.both += other.both;
        self.directions += other.directions;
        self.same += other.same;
        self.near += other.near;
    }

    fn row(&self, table: &mut Table, image: &str, colors: &str) {
        table.row([
            image.into(),
            colors.into(),
            self.detected.into(),
            self.labeled.into(),
            self.both.into(),
            number(self.both as f64 / self.detected as f64, 3),
            number(self.both as f64 / self.labeled as f64, 3),
            self.directions.into(),
            self.same.into(),
            self.near.into(),
        ]);
    }
}

/// A labeled photograph.
struct Photograph {
    name: String,
    rgb: image::RgbImage,
    camera: MirrorCamera,
    /// Radius at which the floor ends in each direction, px; `None` without a label.
    labels: Vec<Option<f64>>,
}

impl Photograph {
    fn read(folder: &Path, calibration: &Value, line: &str) -> Result<Self, String> {
        let (name, labels) = line.split_once(':').ok_or("labels.txt: a line needs a name")?;
        let rgb = load_rgb(&folder.join(format!("{name}.png")))?;
        let camera = camera(&calibration[name.split('_').next().unwrap_or_default()], rgb.dimensions())?;
        let labels = labels.split_whitespace().map(|label| label.parse().ok()).collect();
        Ok(Self { name: name.to_owned(), rgb, camera, labels })
    }

    /// Learns the floor's colors from the even directions.
    fn learn(&self) -> FloorColors {
        let mut training = FloorTraining::default();
        let image = self.camera.image();
        for (u, v, pixel) in self.rgb.enumerate_pixels() {
            let point = image.mirror_from_pixel(Vector2::new(f64::from(u), f64::from(v)));
            let share = point.y.atan2(point.x).rem_euclid(TAU) / TAU;
            let direction = (share * self.labels.len() as f64) as usize;
            let Some(&Some(label_px)) = self.labels.get(direction) else { continue };
            let radius_px = point.norm();
            let is_certain = (radius_px - label_px).abs() > UNCERTAIN_PX && image.is_in_ring(radius_px);
            if direction.is_multiple_of(2) && is_certain {
                let label = if radius_px < label_px { Label::Floor } else { Label::Other };
                training.add(pixel.0, label);
            }
        }
        training.table()
    }

    /// Evaluates all directions, or the odd ones with learned colors.
    fn evaluate(&self, config: &Config, learned: Option<FloorColors>) -> Result<Score, String> {
        let step = if learned.is_some() { 2 } else { 1 };
        let mut observer =
            RingObserver::new(config, &self.camera, &Mount::level(HEIGHT_M), RADIUS_M, learned)
                .map_err(|error| error.to_string())?;
        let (width, height) = (self.rgb.width() as usize, self.rgb.height() as usize);
        let view = RgbView::new(self.rgb.as_raw(), width, height, 3 * width).map_err(|e| e.to_string())?;
        // A cell becomes free after two images.
        let mut result = Ok(());
        for _ in 0..2 {
            result = observer.observe(view);
        }
        if let Err(trouble) = result {
            eprintln!("{}: the behavior would refuse the image: {trouble:?}", self.name);
            for _ in 0..2 {
                observer.distances_of(view);
            }
        }
        let edges = observer.edges_px();
        let is_free = |label_px: f64, ring: usize| {
            let [inner, outer] = [edges[ring], edges[ring + 1]].map(|edge| edge * edge);
            label_px * label_px - inner >= config.free_share * (outer - inner)
        };
        let mut score = Score::default();
        let directions = observer.free().rings().iter().zip(&self.labels);
        for (&detected, label) in directions.skip(step - 1).step_by(step) {
            let Some(label) = *label else { continue };
            let labeled = (0..edges.len() - 1).take_while(|&ring| is_free(label, ring)).count();
            score.detected += detected;
            score.labeled += labeled;
            score.both += detected.min(labeled);
            score.directions += 1;
            score.same += usize::from(detected == labeled);
            score.near += usize::from(detected.abs_diff(labeled) <= 1);
        }
        Ok(score)
    }
}

/// Returns the mirror camera of a team from its calibration: floor radius a tan(b R).
fn camera(team: &Value, (width, height): (u32, u32)) -> Result<MirrorCamera, String> {
    let number = |value: &Value, key: &str| value[key].as_f64().ok_or(format!("calibration.json: no {key}"));
    let center = Vector2::new(number(team, "cu")?, number(team, "cv")?);
    let [blind_px, rim_px] =
        [number(&team["roi"], "small_radius")?, number(&team["roi"], "big_radius")? - 5.0];
    let [range_m, rad_per_px] = [number(team, "a")?, number(team, "b")?];
    let profile = RadialProfile::Tangent { range_m, rad_per_px, height_m: HEIGHT_M };
    let image = MirrorImage::centered(width, height)
        .with_center(center)
        .and_then(|image| image.with_ring(blind_px, rim_px))
        .map_err(|error| error.to_string())?;
    let model = RadialModel::new(profile, blind_px, rim_px).map_err(|error| error.to_string())?;
    MirrorCamera::new(image, Mirror::Radial(model)).map_err(|error| error.to_string())
}
