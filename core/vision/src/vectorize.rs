//! Runtime dispatch of loop kernels to the widest vector instructions of the processor.
//!
//! Kernels are plain loops over slices that the compiler vectorizes. On x86-64 they are compiled a second time for AVX2
//! and POPCNT, selected at run time; on AArch64, NEON is part of the base instruction set.

/// Loops to be compiled once for each instruction set. `run` must be `#[inline(always)]`.
pub trait Kernel {
    /// Result of the loops.
    type Output;
    /// Runs the loops.
    fn run(self) -> Self::Output;
}

/// Runs `kernel` with AVX2 if the processor has it.
#[inline]
pub fn run<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("popcnt") {
        #[allow(unsafe_code, reason = "guarded by the detection of both instruction sets")]
        return unsafe { run_avx2(kernel) };
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,popcnt")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
