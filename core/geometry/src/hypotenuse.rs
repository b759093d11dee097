//! Lengths of hypotenuses, to the same bit on every processor.

/// Length of the hypotenuse of a right triangle.
///
/// `f64::hypot` calls the C library, whose result differs by one unit in the last place between x86-64 and ARM, for one pair in
/// eight: there it uses the processor's fused multiplication. A recording of a robot would then not replay to the byte on a laptop.
pub trait Hypotenuse {
    /// Returns the square root of the sum of the squares of both sides; infinite above 1e154 for `f64`, 1e19 for `f32`.
    #[must_use]
    fn hypotenuse(self, other: Self) -> Self;
}

impl Hypotenuse for f64 {
    fn hypotenuse(self, other: f64) -> f64 {
        (self * self + other * other).sqrt()
    }
}

impl Hypotenuse for f32 {
    fn hypotenuse(self, other: f32) -> f32 {
        (self * self + other * other).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_is_exact_where_it_can_be() {
        assert_eq!((3.0_f64.hypotenuse(-4.0), 0.0_f64.hypotenuse(0.0)), (5.0, 0.0));
        assert_eq!(5.0_f32.hypotenuse(12.0), 13.0);
        assert!(f64::NAN.hypotenuse(1.0).is_nan() && f64::INFINITY.hypotenuse(1.0).is_infinite());
        // The C library gives 2.4676132378595375 on x86-64, 2.467613237859538 on ARM.
        assert_eq!(2.412_774_888_735_042_6_f64.hypotenuse(0.517_332_028_729_358_4), 2.467_613_237_859_537_5);
    }
}
