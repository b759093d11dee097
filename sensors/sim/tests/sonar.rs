//! Sonar model: echoes, specular reflection, lost readings.

use yamabico_core::geometry::Pose2;
use yamabico_sim::sonar::{SonarConfig, measure_range};
use yamabico_sim::{Scene, World, random};

fn read(world: &str, config: &SonarConfig, robot: Pose2, azimuth_rad: f64) -> Option<f64> {
    let scene = Scene::new(&World::from_toml(world).unwrap(), 1).unwrap();
    measure_range(config, azimuth_rad, &scene, scene.people(), &robot, &mut random::stream(1, "sonar"))
}

fn quiet() -> SonarConfig {
    SonarConfig { noise_m: 0.0, dropout: 0.0, x_m: 0.0, ..SonarConfig::default() }
}

const WALL: &str = "[[wall]]\nfrom_m = [1, -3]\nto_m = [1, 3]";

#[test]
fn a_wall_returns_an_echo_head_on_and_none_at_an_oblique_angle() {
    let straight = read(WALL, &quiet(), Pose2::IDENTITY, 0.0).unwrap();
    assert!((straight - 1.0).abs() < 1e-3, "{straight}");
    // The cone's nearest ray to the normal is 35 - 12.5 = 22.5 degrees off, within 25; at 40 it is not.
    let turned = |deg: f64| read(WALL, &quiet(), Pose2::new(0.0, 0.0, deg.to_radians()), 0.0);
    assert!((turned(35.0).unwrap() - 1.0 / 22.5_f64.to_radians().cos()).abs() < 0.01, "{:?}", turned(35.0));
    assert_eq!(turned(40.0), None);
    assert!(read(WALL, &quiet(), Pose2::new(0.0, 0.0, 40_f64.to_radians()), -40_f64.to_radians()).is_some());
}

#[test]
fn echoes_out_of_range_are_not_reported() {
    assert_eq!(read(WALL, &SonarConfig { max_m: 0.9, ..quiet() }, Pose2::IDENTITY, 0.0), None);
    assert!(read(WALL, &SonarConfig { max_m: 1.1, ..quiet() }, Pose2::IDENTITY, 0.0).is_some());
}

#[test]
fn a_person_returns_an_echo_at_any_angle_and_occludes_the_wall() {
    let world = format!("{WALL}\n[[person]]\npath_m = [[0.7, 0.08]]");
    let echo = read(&world, &quiet(), Pose2::IDENTITY, 0.0).unwrap();
    assert!((echo - 0.52).abs() < 0.02, "{echo}");
    assert!(read(&world, &quiet(), Pose2::IDENTITY, 15_f64.to_radians()).is_some());
}

#[test]
fn dropout_and_noise_are_as_configured() {
    let config = SonarConfig { noise_m: 0.01, dropout: 0.1, ..quiet() };
    let scene = Scene::new(&World::from_toml(WALL).unwrap(), 1).unwrap();
    let mut rng = random::stream(5, "sonar");
    let heard: Vec<f64> = (0..2000)
        .filter_map(|_| measure_range(&config, 0.0, &scene, &[], &Pose2::IDENTITY, &mut rng))
        .collect();
    assert!((1750..1850).contains(&heard.len()), "{}", heard.len());
    let variance = heard.iter().map(|r| (r - 1.0).powi(2)).sum::<f64>() / heard.len() as f64;
    assert!((variance.sqrt() - 0.01).abs() < 0.001, "{}", variance.sqrt());
}
