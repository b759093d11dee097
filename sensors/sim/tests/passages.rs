//! The simulated sonars tell passages from surfaces.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../examples/tell_passages/cases.rs"]
mod cases;

use cases::{CLEAN, POOR, Tally};

#[test]
fn passages_and_surfaces_are_told_apart() {
    for kind in [CLEAN, POOR] {
        let tally = Tally::of(&kind, 20).unwrap();
        assert_eq!((tally.cases, tally.right), (20, 20), "{}: {tally:?}", kind.name);
        assert!(tally.quantile_s(0.5) < 1.0, "{}: after {} s", kind.name, tally.quantile_s(0.5));
    }
}
