//! A laser scanner takes the place of sonars in a task by its robot file alone.

use yamabico::plugins::plugins;
use yamabico_host::config::{InputSource, Overrides, load};
use yamabico_runtime::record::Tee;

use crate::support::run_seed;

#[test]
fn the_hallway_is_driven_with_a_laser_scanner_in_place_of_sonars() {
    let robot = yamabico_testkit::config("robots/sim-hallway-lidar.toml");
    let thresholds = yamabico_testkit::config("maps/hallway-thresholds.toml");
    let passages = [r#"method="passages""#.to_owned(), format!("thresholds={thresholds:?}")]
        .map(|set| format!("behaviors.stationary-obstacle-avoider.{set}"));
    for (seed, set) in [(1, passages.to_vec()), (2, vec![])] {
        let overrides = Overrides { robot: Some(robot.clone()), set };
        let path = yamabico_testkit::config("hallway.toml");
        let task = load(&path, &overrides, &plugins()).unwrap_or_else(|problems| panic!("{problems}"));
        let sources = |behavior: &str, sensor: &str| {
            let behavior = task.behaviors.iter().find(|known| known.name == behavior).unwrap();
            behavior
                .inputs
                .iter()
                .any(|input| matches!(&input.source, InputSource::Sensor(name) if name == sensor))
        };
        for behavior in ["sonar-halt", "stationary-obstacle-avoider", "stuck-recovery"] {
            assert!(sources(behavior, "laser"), "{behavior}");
        }
        assert!(sources("sonar-halt", "bumper"));
        let summary = run_seed(&task, seed, &mut Tee::default()).summary;
        assert!(summary.arrived, "seed {seed}: not arrived");
        assert_eq!((summary.contacts, summary.struck), (Some(0), Some(0)), "seed {seed}");
    }
}
