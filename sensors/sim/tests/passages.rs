//! Passages and surfaces are distinguished with the simulated sonars.

use yamabico_rigs::passages::{CLEAN, POOR, Tally};

#[test]
fn passages_and_surfaces_are_distinguished() {
    for sonar in [CLEAN, POOR] {
        let tally = Tally::of(&sonar, 0..20).unwrap();
        assert_eq!((tally.cases, tally.correct), (20, 20), "{}: {tally:?}", sonar.name);
        let median_s = tally.decided_s[tally.decided_s.len() / 2];
        assert!(median_s < 1.0, "{}: after {median_s} s", sonar.name);
    }
}
