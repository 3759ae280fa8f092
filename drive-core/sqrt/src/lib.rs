//! Square root of an `f32`, correctly rounded. It uses `VSQRT.F32` on a Cortex-M with a floating-point unit, 14 cycles, and
//! [`libm`] elsewhere. `libm` does not use this instruction and takes 93 cycles; `core::f32::math::sqrt` is not stable yet.
#![no_std]

/// Returns the square root of `x`, correctly rounded, so that host and target agree to the bit; NaN for a negative number.
///
/// ```
/// assert_eq!(fpu_sqrt::sqrtf(2.0).to_bits(), 0x3fb5_04f3);
/// assert!(fpu_sqrt::sqrtf(-1.0).is_nan());
/// ```
#[inline(always)]
#[must_use]
pub fn sqrtf(x: f32) -> f32 {
    #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
    {
        let mut bits = x.to_bits();
        // With single precision alone, the compiler has no register class to choose from, so the
        // registers are named. SAFETY: instructions on registers, without memory, stack or flags.
        unsafe {
            core::arch::asm!(
                "vmov s0, {0}",
                "vsqrt.f32 s0, s0",
                "vmov {0}, s0",
                inout(reg) bits,
                out("s0") _,
                options(pure, nomem, nostack, preserves_flags),
            );
        }
        f32::from_bits(bits)
    }
    #[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
    libm::sqrtf(x)
}
