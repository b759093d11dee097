//! Runs a kernel with the widest vector instructions that the processor has.
//!
//! Kernels are plain loops over slices that the compiler vectorizes. On x86-64 the same loops are compiled a second time
//! for AVX2 and the counting of bits, chosen at run time; on AArch64 NEON is part of the base, so that the plain version has it already.

/// A loop nest to be compiled once for each instruction set; its `run` must be `#[inline(always)]`.
pub(crate) trait Kernel {
    /// What the loops give back.
    type Output;
    /// The loops.
    fn run(self) -> Self::Output;
}

/// Runs `kernel` with AVX2 where the processor has it.
#[inline]
pub(crate) fn run<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("popcnt") {
        #[allow(unsafe_code, reason = "the line above made sure that the processor has both")]
        return unsafe { run_avx2(kernel) };
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,popcnt")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
