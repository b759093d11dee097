//! Corridor or none on recorded photographs: the claims hold on the data sets, which are not part of the repository.

use nalgebra::{Vector2, Vector3};
use serde_json::Value;
use std::path::Path;
use yamabico_geometry::camera::{Calibration, Intrinsics, Mount};
use yamabico_geometry::image::GrayImage;
use yamabico_testkit::data::data_set;
use yamabico_vision::corridor_evidence::{Coefficients, CorridorJudge, EvidenceTrack, Picture, RowPrior};
use yamabico_vision::segments::{SegmentConfig, SegmentDetector};

/// Maximum error of a right heading, degrees.
const RIGHT_DEG: f64 = 3.0;

/// Answer about one photograph.
struct Answer {
    probability: f64,
    acting: f64,
    point: Option<Vector2<f64>>,
    camera: Intrinsics,
}

impl Answer {
    /// Angle between the columns of the answer and of a label, degrees.
    fn off_deg(&self, label: Vector2<f64>) -> f64 {
        let heading = |u: f64| ((u - self.camera.cx) / self.camera.fx).atan();
        self.point.map_or(90.0, |point| (heading(point.x) - heading(label.x)).abs().to_degrees())
    }
}

fn load(path: &Path) -> GrayImage {
    let rgb = image::open(path).unwrap().to_rgb8();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    let mut gray = GrayImage::default();
    gray.copy_from_rgb8(rgb.as_raw(), width, height, 3 * width).unwrap();
    gray
}

/// Judges one photograph alone, and after those before it in `track`.
fn judge(path: &Path, known: Option<Intrinsics>, track: &mut Option<EvidenceTrack>) -> Answer {
    let image = load(path);
    let view = image.view().unwrap();
    let (width, height) = (view.width() as f64, view.height() as f64);
    let camera = known.unwrap_or(Intrinsics {
        fx: 0.5 * width,
        fy: 0.5 * width,
        cx: 0.5 * (width - 1.0),
        cy: 0.5 * (height - 1.0),
        width: view.width() as u32,
        height: view.height() as u32,
    });
    let calibration = known.map_or(Calibration::Guessed, |_| Calibration::Measured);
    let picture = Picture::of(&camera);
    let start = RowPrior::of_mount(&picture, &Mount::level(1.0), calibration, None);
    let mut detector = SegmentDetector::new(SegmentConfig::for_evidence());
    let segments = detector.detect(view).unwrap_or_default();
    let mut judge = CorridorJudge::new(Coefficients::SEGMENTS_2, 0.5);
    let track = track.get_or_insert(EvidenceTrack::new(start));
    track.predict(0.0, 10_f64.to_radians(), 0.0);
    let tracked = judge.look(segments, &picture, &track.row_prior(), None);
    track.update(&picture, tracked.hypothesis.map(|found| (found.point, tracked.probability)));
    let acting = track.acting_probability(tracked.probability);
    let alone = judge.look(segments, &picture, &start, None);
    let point = alone.hypothesis.map(|found| found.point / picture.scale);
    Answer { probability: alone.probability, acting, point, camera }
}

/// Counts answers that are right and sure, over all data sets.
#[derive(Default)]
struct Sure {
    sure: usize,
    right: usize,
}

impl Sure {
    fn add(&mut self, answer: &Answer, is_right: bool) {
        self.sure += usize::from(answer.probability >= 0.9);
        self.right += usize::from(answer.probability >= 0.9 && is_right);
    }
}

fn lines(path: &Path) -> Vec<String> {
    std::fs::read_to_string(path).unwrap().lines().skip(1).map(str::to_owned).collect()
}

fn multi_floor(folder: &Path, sure: &mut Sure) {
    let (mut right, mut corridors, mut wrong, mut none) = (0, 0, 0, 0);
    let (mut tracked_wrong, mut driven, mut tracks) = (0, 0, std::collections::BTreeMap::new());
    for line in lines(&folder.join("vanishing_points.csv")) {
        let fields: Vec<&str> = line.split(',').collect();
        let track = tracks.entry(fields[0][..2].to_owned()).or_default();
        let answer = judge(&folder.join("images").join(fields[0]), None, track);
        let is_right = match (fields[1].parse(), fields[2].parse()) {
            (Ok(u), Ok(v)) => {
                corridors += 1;
                driven += usize::from(answer.acting >= 0.5);
                answer.off_deg(Vector2::new(u, v)) <= RIGHT_DEG
            }
            _ => {
                none += 1;
                wrong += usize::from(answer.probability > 0.5);
                tracked_wrong += usize::from(answer.acting > 0.5);
                false
            }
        };
        right += usize::from(is_right);
        sure.add(&answer, is_right);
    }
    println!(
        "multi_floor: {right} of {corridors} right, {driven} driven when tracked; none in view: {wrong} of {none} wrong, \
         {tracked_wrong} when tracked"
    );
    assert!(right >= 41 && wrong <= 1, "{right} of {corridors}, {wrong} of {none}");
}

fn no_corridor(folder: &Path, sure: &mut Sure) {
    let (mut wrong, mut count) = (0, 0);
    for line in lines(&folder.join("index.csv")) {
        let file = line.split(',').next().unwrap();
        let answer = judge(&folder.join("images").join(file), None, &mut None);
        wrong += usize::from(answer.probability > 0.5);
        count += 1;
        sure.add(&answer, false);
    }
    println!("no_corridor: {wrong} of {count} wrong");
    assert!(wrong <= 4, "{wrong} of {count}");
}

fn corridor_drive(folder: &Path, sure: &mut Sure) {
    let (mut right, mut off_px, mut track) = (0, Vec::new(), None);
    for line in lines(&folder.join("labels.csv")) {
        // The polygons between the quotes contain commas; the point is the last two fields.
        let mut last = line.rsplit(',');
        let (v, u) = (last.next().unwrap().parse(), last.next().unwrap().parse());
        let (Ok(u), Ok(v)) = (u, v) else { continue };
        let name = format!("{}.jpg", line.split(',').next().unwrap());
        let answer = judge(&folder.join("images").join(name), None, &mut track);
        let is_right = answer.off_deg(Vector2::new(u, v)) <= RIGHT_DEG;
        off_px.push(answer.point.map_or(480.0, |point| (point.x - u).abs()));
        right += usize::from(is_right);
        sure.add(&answer, is_right);
    }
    off_px.sort_by(f64::total_cmp);
    let (median, most) = (off_px[off_px.len() / 2], off_px[off_px.len() * 9 / 10]);
    println!("corridor_drive: {right} of {} right, median {median:.1}, 90 % {most:.1} px", off_px.len());
    assert!(right >= 107 && most <= 19.0, "{right} of {}, 90 % {most} px", off_px.len());
}

fn york_urban(folder: &Path, sure: &mut Sure) {
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("ground_truth.json")).unwrap()).unwrap();
    let of = |key: &str| truth["camera"][key].as_f64().unwrap();
    let camera =
        Intrinsics { fx: of("f_px"), fy: of("f_px"), cx: of("cx"), cy: of("cy"), width: 640, height: 480 };
    let (mut right, mut count, mut indoor_right, mut indoor) = (0, 0, 0, 0);
    for entry in truth["images"].as_array().unwrap() {
        let Some(index) = entry["in_image_horizontal_vp"]["vp_index"].as_u64() else { continue };
        let axis = Vector3::from_fn(|i, _| entry["vp_dirs"][index as usize][i].as_f64().unwrap());
        let answer = judge(&folder.join(entry["file"].as_str().unwrap()), Some(camera), &mut None);
        let is_right = answer.point.is_some_and(|point| {
            let ray = camera.normalized_from_pixel(point).push(1.0);
            ray.normalize().dot(&axis.normalize()).abs() >= RIGHT_DEG.to_radians().cos()
        });
        (right, count) = (right + usize::from(is_right), count + 1);
        if !is_right {
            println!("york_urban: {} is wrong, probability {:.2}", entry["file"], answer.probability);
        }
        if entry["indoor"].as_bool() == Some(true) {
            (indoor_right, indoor) = (indoor_right + usize::from(is_right), indoor + 1);
            sure.add(&answer, is_right);
        }
    }
    println!("york_urban: {right} of {count} right, indoor {indoor_right} of {indoor}");
    assert!(right >= 23 && indoor_right == indoor, "{right} of {count}, indoor {indoor_right} of {indoor}");
}

/// Checks one data set and counts its sure answers.
type Check = fn(&Path, &mut Sure);

#[test]
fn a_sure_answer_is_right_on_every_data_set() {
    let mut sure = Sure::default();
    let sets: [(&str, Check); 4] = [
        ("multi_floor", multi_floor),
        ("no_corridor", no_corridor),
        ("corridor_drive", corridor_drive),
        ("york_urban", york_urban),
    ];
    for (name, check) in sets {
        let Some(folder) = data_set(name) else { continue };
        check(&folder, &mut sure);
    }
    let Sure { sure, right } = sure;
    println!("probability at least 0.9: {right} of {sure} right");
    assert!(100 * right >= 95 * sure, "{right} of {sure}");
}
