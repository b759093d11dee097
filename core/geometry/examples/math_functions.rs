//! Prints a digest of each mathematical function of the C library over 300,000 arguments: equal digests on two machines mean equal bits.
//!
//! It needs no crate, so that `rustc` alone builds it for any processor: see `arbiter/cli/package/aarch64.sh functions`.

#![allow(clippy::disallowed_methods, reason = "it shows which of them differ")]

use std::hint::black_box;

const COUNT: usize = 300_000;

/// A function of one or two numbers in [0, 1), which it maps to its own domain.
type Function = fn(f64, f64) -> f64;

const FUNCTIONS: [(&str, Function); 31] = [
    ("sin", |a, _| (10.0 * a - 5.0).sin()),
    ("cos", |a, _| (10.0 * a - 5.0).cos()),
    ("tan", |a, _| (3.0 * a - 1.5).tan()),
    ("asin", |a, _| (2.0 * a - 1.0).asin()),
    ("acos", |a, _| (2.0 * a - 1.0).acos()),
    ("atan", |a, _| (40.0 * a - 20.0).atan()),
    ("atan2", |a, b| (2.0 * a - 1.0).atan2(2.0 * b - 1.0)),
    ("sinh", |a, _| (2.0 * a - 1.0).sinh()),
    ("tanh", |a, _| (2.0 * a - 1.0).tanh()),
    ("exp", |a, _| (2.0 - 20.0 * a).exp()),
    ("exp2", |a, _| (2.0 - 20.0 * a).exp2()),
    ("exp_m1", |a, _| a.exp_m1()),
    ("ln", |a, _| (9.0 * a + 1e-9).ln()),
    ("ln_1p", |a, _| a.ln_1p()),
    ("log2", |a, _| (9.0 * a + 1e-9).log2()),
    ("log10", |a, _| (9.0 * a + 1e-9).log10()),
    ("powf", |a, b| (3.0 * a).powf(4.0 * b - 2.0)),
    ("powi", |a, b| (3.0 * a).powi((9.0 * b) as i32 - 4)),
    ("sqrt", |a, _| a.sqrt()),
    ("cbrt", |a, _| (8.0 * a - 4.0).cbrt()),
    ("hypot", |a, b| (4.0 * a).hypot(b)),
    ("sin of f32", |a, _| f64::from((10.0 * a as f32 - 5.0).sin())),
    ("cos of f32", |a, _| f64::from((10.0 * a as f32 - 5.0).cos())),
    ("tan of f32", |a, _| f64::from((3.0 * a as f32 - 1.5).tan())),
    ("acos of f32", |a, _| f64::from((2.0 * a as f32 - 1.0).acos())),
    ("atan2 of f32", |a, b| f64::from((2.0 * a as f32 - 1.0).atan2(2.0 * b as f32 - 1.0))),
    ("exp of f32", |a, _| f64::from((2.0 - 20.0 * a as f32).exp())),
    ("ln of f32", |a, _| f64::from((9.0 * a as f32 + 1e-9).ln())),
    ("powf of f32", |a, b| f64::from((3.0 * a as f32).powf(4.0 * b as f32 - 2.0))),
    ("cbrt of f32", |a, _| f64::from((8.0 * a as f32 - 4.0).cbrt())),
    ("hypot of f32", |a, b| f64::from((4.0 * a as f32).hypot(b as f32))),
];

fn main() {
    for (name, function) in FUNCTIONS {
        let (mut state, mut digest) = (42_u64, 0xcbf2_9ce4_8422_2325_u64);
        for _ in 0..COUNT {
            let (a, b) = (next(&mut state), next(&mut state));
            digest = (digest ^ function(black_box(a), black_box(b)).to_bits()).wrapping_mul(0x0100_0000_01b3);
        }
        println!("{name}: {digest:016x}");
    }
}

/// Next pseudo-random number in [0, 1).
fn next(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    let mixed = (*state ^ (*state >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    ((mixed ^ (mixed >> 33)) >> 11) as f64 / (1_u64 << 53) as f64
}
