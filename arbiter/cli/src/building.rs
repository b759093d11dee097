//! Folder of a building drawn from a seed: its world, its map, a robot, and a task with the map and one without.

use std::path::{Path, PathBuf};

use yamabico_sim::building::Building;

/// Names and texts of the files that are filled in.
const TEMPLATES: [(&str, &str); 3] = [
    ("robot.toml", include_str!("../templates/building/robot.toml")),
    (WITH_MAP, include_str!("../templates/building/with-map.toml")),
    (WITHOUT_MAP, include_str!("../templates/building/without-map.toml")),
];
/// File name of the task with a map.
pub const WITH_MAP: &str = "with-map.toml";
/// File name of the task without a map.
pub const WITHOUT_MAP: &str = "without-map.toml";
/// Speed at which the duration of a task is reckoned, m/s: a fifth of the cruising speed.
const SLOWEST_MPS: f64 = 0.08;
/// Distance from the walls at which a robot without a map reaches the goal, m: the radius of the robot.
const ROBOT_RADIUS_M: f64 = 0.2;
/// Maximum sideways offset of the start, as a fraction of the free width.
const START_OFFSET: f64 = 0.15;

/// Writes the files of a building into `folder`, which is created, and returns their names. `repository` is the folder of
/// Yamabico's sources, with the parts of the robot.
///
/// # Errors
/// A file cannot be written.
pub fn write(building: &Building, folder: &Path, repository: &Path) -> Result<Vec<&'static str>, String> {
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("cannot create {}: {error}", folder.display()))?;
    let map = format!(
        "# Edges and walls of building {}, from its world file; boxes and people are not on it.\n\n{}",
        building.seed,
        building.world.wire_frame().to_toml()
    );
    let mut files = vec![("world.toml", building.world_toml()), ("map.toml", map)];
    files.extend(TEMPLATES.map(|(file, text)| (file, filled(text, building, repository))));
    for (file, text) in &files {
        let path = folder.join(file);
        std::fs::write(&path, text).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    }
    Ok(files.into_iter().map(|(file, _)| file).collect())
}

/// Returns the folder of Yamabico's sources: `given`, or else the working directory or one above it, or the folder that this
/// program was built from.
///
/// # Errors
/// The sources are in none of them; the error says what to do.
pub fn find_repository(given: Option<&Path>) -> Result<PathBuf, String> {
    let here = std::env::current_dir().unwrap_or_default();
    let built_from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let found = match given {
        Some(folder) => Some(folder).filter(|folder| is_repository(folder)),
        None => here.ancestors().chain([built_from.as_path()]).find(|folder| is_repository(folder)),
    };
    found.and_then(|folder| folder.canonicalize().ok()).ok_or_else(|| match given {
        Some(folder) => format!(
            "{} does not contain Yamabico's sources (--repository): give the folder of a clone of the repository",
            folder.display()
        ),
        None => "Yamabico's sources, which the new files depend on, were not found: clone the repository and give its \
                 folder with --repository DIR"
            .to_owned(),
    })
}

fn is_repository(folder: &Path) -> bool {
    let manifest = std::fs::read_to_string(folder.join("core/Cargo.toml"));
    manifest.is_ok_and(|text| text.contains("name = \"yamabico-core\""))
}

fn filled(template: &str, building: &Building, repository: &Path) -> String {
    let p = &building.properties;
    let (intrinsics, _) = building.camera();
    let lens = building.photometry();
    let free_m = p.width_m / 2.0 - ROBOT_RADIUS_M;
    let values = [
        ("repository", repository.to_string_lossy().into_owned()),
        ("seed", building.seed.to_string()),
        ("distance_m", number(p.distance_m)),
        ("duration_s", number((p.distance_m / SLOWEST_MPS).round())),
        ("tolerance_m", number(free_m)),
        ("jitter_m", number(START_OFFSET * free_m)),
        ("width", intrinsics.width.to_string()),
        ("height", intrinsics.height.to_string()),
        ("fov_deg", number(p.view_deg)),
        ("camera_m", number(p.camera_m)),
        ("tilt_deg", number(p.tilt_deg)),
        ("dropout", number(p.lost_frames)),
        ("exposure", number(lens.exposure.into())),
        ("noise", number(lens.noise_sigma.into())),
        ("flicker", number(lens.flicker.into())),
        ("blur", number(lens.blur_px.into())),
        ("glare", number(lens.glare.into())),
    ];
    let fill = |text: String, (key, value): &(&str, String)| text.replace(&format!("@{key}@"), value);
    values.iter().fold(template.to_owned(), fill)
}

fn number(value: f64) -> String {
    format!("{}", (value * 1e4).round() / 1e4)
}
