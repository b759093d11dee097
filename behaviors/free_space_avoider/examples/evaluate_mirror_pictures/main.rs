//! How polar cells and a measured mirror do on photographs of a football field through mirrors that others built.
//!
//! `evaluate_mirror_pictures [DIR] [--set TOML]`
//!
//! DIR holds `omni_msl/` (pictures, and how their mirrors show the floor); without it `YAMABICO_DATA`, else `../shared/data` beside the
//! workspace. Cells: those free from the robot outwards beside what `labels.txt` says, which tells how it was made. The floor's
//! colors are first those of each picture's own innermost ring ahead, and then a table learned from every other direction of
//! the picture, and judged in the directions between. Lines: pixels of field lines that others marked in one picture,
//! laid on the floor by the mirror and moved to where they fit the field best; told is how far from a line they end.

mod lines;

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use nalgebra::Vector2;
use serde_json::Value;
use yamabico_core::camera::{Mirror, MirrorCamera, MirrorImage, Mount, RadialModel, RadialProfile};
use yamabico_core::image::RgbView;
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::polar_cells::RingSight;
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::floor_training::{FloorTraining, Label};

const LABELS: &str = include_str!("labels.txt");
/// What the behavior is told. Beyond 8.5 m a pixel is half a meter.
const CONFIG: &str =
    "method = 'polar-cells'\nrings = 24\nfarthest_m = 8.5\nclosing_px = 3\ncolor_tolerance = 40\n";
/// Height of the viewpoint, m: any, as the mirrors were measured on the floor.
const HEIGHT_M: f64 = 0.6;
/// So near to a label (px) a pixel teaches nothing.
const UNSURE_PX: f64 = 4.0;
/// Radius of the robots, m.
const RADIUS_M: f64 = 0.42;

fn main() -> ExitCode {
    match evaluate() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

fn evaluate() -> Result<(), String> {
    let (mut data, mut toml) = (None, CONFIG.parse::<toml::Table>().map_err(|e| e.to_string())?);
    let mut rest = std::env::args().skip(1);
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--set" => {
                let text = rest.next().ok_or("--set needs a value")?;
                toml.extend(text.parse::<toml::Table>().map_err(|e| e.to_string())?);
            }
            _ if data.is_none() && !argument.starts_with('-') => data = Some(PathBuf::from(&argument)),
            _ => return Err(format!("unknown argument {argument}")),
        }
    }
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = data.or_else(|| std::env::var_os("YAMABICO_DATA").map(PathBuf::from)).unwrap_or(beside);
    let folder = data.join("omni_msl");
    if !folder.is_dir() {
        println!("no {}: skipped", folder.display());
        return Ok(());
    }
    let text = std::fs::read_to_string(folder.join("calibration.json")).map_err(|e| e.to_string())?;
    let calibration: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let config: Config = toml.try_into().map_err(|e: toml::de::Error| e.to_string())?;
    let pictures: Vec<Picture> = LABELS
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| Picture::read(&folder, &calibration, line))
        .collect::<Result<_, _>>()?;
    for (how, is_taught) in [("its own floor ahead", false), ("every other direction", true)] {
        let mut all = Score::default();
        for picture in &pictures {
            let score = picture.judge(&config, is_taught.then(|| picture.learn()))?;
            println!("{}, colors of {how}: {}", picture.name, score.text());
            all.add(&score);
        }
        println!("all, colors of {how}: {}", all.text());
    }
    lines::residual(&folder, &calibration)
}

/// Cells that are free from the robot outwards.
#[derive(Default)]
struct Score {
    told: usize,
    labeled: usize,
    both: usize,
    directions: usize,
    /// Directions that end in the same ring, and in the same or the next.
    same: usize,
    near: usize,
}

impl Score {
    fn add(&mut self, other: &Score) {
        self.told += other.told;
        self.labeled += other.labeled;
        self.both += other.both;
        self.directions += other.directions;
        self.same += other.same;
        self.near += other.near;
    }

    fn text(&self) -> String {
        format!(
            "of {} cells told free {} are labeled free (precision {:.3}), of {} labeled free {:.3} are told (recall); \
             {} of {} directions end in the labeled ring, {} within one ring of it",
            self.told,
            self.both,
            self.both as f64 / self.told as f64,
            self.labeled,
            self.both as f64 / self.labeled as f64,
            self.same,
            self.directions,
            self.near,
        )
    }
}

/// A labeled picture.
struct Picture {
    name: String,
    rgb: image::RgbImage,
    camera: MirrorCamera,
    /// Where the floor ends in each direction, pixels; `None` where that was not labeled.
    labels: Vec<Option<f64>>,
}

impl Picture {
    fn read(folder: &Path, calibration: &Value, line: &str) -> Result<Self, String> {
        let (name, labels) = line.split_once(':').ok_or("labels.txt: a line needs a name")?;
        let path = folder.join(format!("{name}.png"));
        let rgb = image::open(&path).map_err(|e| format!("{}: {e}", path.display()))?.to_rgb8();
        let camera = camera(&calibration[name.split('_').next().unwrap_or_default()], rgb.dimensions())?;
        let labels = labels.split_whitespace().map(|label| label.parse().ok()).collect();
        Ok(Self { name: name.to_owned(), rgb, camera, labels })
    }

    /// Colors that tell the floor in the even directions.
    fn learn(&self) -> FloorColors {
        let mut training = FloorTraining::default();
        let image = self.camera.image();
        for (u, v, pixel) in self.rgb.enumerate_pixels() {
            let point = image.mirror_from_pixel(Vector2::new(f64::from(u), f64::from(v)));
            let share = point.y.atan2(point.x).rem_euclid(TAU) / TAU;
            let direction = (share * self.labels.len() as f64) as usize;
            let Some(&Some(label_px)) = self.labels.get(direction) else { continue };
            let radius_px = point.norm();
            let is_sure = (radius_px - label_px).abs() > UNSURE_PX && image.is_in_ring(radius_px);
            if direction.is_multiple_of(2) && is_sure {
                let label = if radius_px < label_px { Label::Floor } else { Label::Other };
                training.add(pixel.0, label);
            }
        }
        training.table()
    }

    /// The score: of all directions, or with learned colors of the odd ones.
    fn judge(&self, config: &Config, learned: Option<FloorColors>) -> Result<Score, String> {
        let step = if learned.is_some() { 2 } else { 1 };
        let mut sight = RingSight::new(config, &self.camera, &Mount::level(HEIGHT_M), RADIUS_M, learned)
            .map_err(|problem| problem.to_string())?;
        let (width, height) = (self.rgb.width() as usize, self.rgb.height() as usize);
        let view = RgbView::new(self.rgb.as_raw(), width, height, 3 * width).map_err(|e| e.to_string())?;
        // A cell is free once it has been so in two pictures.
        let mut looked = Ok(());
        for _ in 0..2 {
            looked = sight.see(view);
        }
        if let Err(trouble) = looked {
            println!("{}: would be refused, {trouble:?}", self.name);
            for _ in 0..2 {
                sight.distances_of(view);
            }
        }
        let edges = sight.edges_px();
        let is_free = |label_px: f64, ring: usize| {
            let [inner, outer] = [edges[ring], edges[ring + 1]].map(|edge| edge * edge);
            label_px * label_px - inner >= config.free_share * (outer - inner)
        };
        let mut score = Score::default();
        let directions = sight.free().rings().iter().zip(&self.labels);
        for (&told, label) in directions.skip(step - 1).step_by(step) {
            let Some(label) = *label else { continue };
            let labeled = (0..edges.len() - 1).take_while(|&ring| is_free(label, ring)).count();
            score.told += told;
            score.labeled += labeled;
            score.both += told.min(labeled);
            score.directions += 1;
            score.same += usize::from(told == labeled);
            score.near += usize::from(told.abs_diff(labeled) <= 1);
        }
        Ok(score)
    }
}

/// The mirror of a team as its calibration has it: floor radius a tan(b R).
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
        .map_err(|e| e.to_string())?;
    let model = RadialModel::new(profile, blind_px, rim_px).map_err(|e| e.to_string())?;
    MirrorCamera::new(image, Mirror::Radial(model)).map_err(|e| e.to_string())
}
