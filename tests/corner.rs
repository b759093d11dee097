//! The acute corner: the robot drives around it without contact, and sooner if it considers its velocity.

use yamabico_runtime::execution::RunEnd;
use yamabico_runtime::record::Tee;

use crate::support::{run_seed, task};

const SEEDS: [u64; 3] = [1, 2, 3];

/// Returns the total time of all seeds, s.
fn time_s(velocity: &str) -> f64 {
    let task = task("corner", &[&format!("behaviors.free-space-avoider.velocity=\"{velocity}\"")]);
    let drive = |seed| {
        let result = run_seed(&task, seed, &mut Tee::default());
        assert_eq!(
            (result.end, result.summary.contacts),
            (RunEnd::Arrived, Some(0)),
            "{velocity}, seed {seed}"
        );
        result.summary.time_s
    };
    SEEDS.map(drive).iter().sum()
}

#[test]
fn the_robot_is_sooner_around_the_corner_if_it_considers_its_velocity() {
    let [considered_s, ignored_s] = ["considered", "ignored"].map(time_s);
    assert!(considered_s < ignored_s, "{considered_s} s and {ignored_s} s");
}
