//! The three filters of section 3.10 (Appendix C), as second-order sections at 6 kHz.
//!
//! The printed tables are elliptic designs without misprints: LPF = `ellip(4, 0.5, 40,
//! [450 650]/3000, 'stop')`, BPF = `ellip(2, 0.5, 40, [500 700]/3000)`, PP = `ellip(4, 0.5, 60,
//! 100/3000)`. The sections below match the printed transfer functions to 6e-6 with their
//! coefficients in `f32`; pairing and order minimise rounding noise. Error against the printed direct
//! form in `f64`, measured over 600 000 samples with inputs up to 3 A:
//!
//! | | rms | largest |
//! |---|---|---|
//! | LPF | 2.0 µA | 7 µA |
//! | BPF | 0.5 µA | 3 µA |
//! | PP | 10.5 µA | 58 µA |
//!
//! Responses:
//!
//! | | gain at dc | at 600 Hz | group delay at dc | at 600 Hz | pass band (-0.5 dB) |
//! |---|---|---|---|---|---|
//! | [`LPF`] | 1 | -47.8 dB | 1.53 samples | - | below 450 Hz, above 650 Hz |
//! | [`LPF_AS_PRINTED`] | 0.94406 | -48.3 dB | 1.53 | - | |
//! | [`BPF`] | 0.01000 | -0.49 dB, -3.9° | 0.80 | 8.83 | 500 Hz to 700 Hz |
//! | [`PP`] | 0.94406 | -75.8 dB | 24.46 | - | below 100 Hz |

use crate::AlphaBeta;
use crate::filter::sos::{Sos, SosState};

/// "LPF" as printed (Table 7): an 8th-order band stop around the injected 600 Hz.
///
/// Its gain at dc is 0.944061, so a loop closed around it makes every real current 5.9 % too
/// large; for control use [`LPF`]. It passes everything above 650 Hz and is neither an anti-alias nor a
/// noise filter. 600 Hz lies 6.5 Hz inside the -40 dB edge, so in alpha-beta the sidebands of the
/// injection leak through above about 6 Hz electrical.
///
/// `b0` is 1 in all sections except the last, which carries the whole gain. Since the coefficients are constant,
/// the compiler removes the multiplications by 1.
#[rustfmt::skip]
pub const LPF_AS_PRINTED: Sos<4> = Sos::from_f64(&[
    [1.0, -1.7146060941391668, 1.0, -1.6493510618854281, 0.8415222895964312],
    [1.0, -1.615108590136334, 1.0, -1.5363028638209513, 0.9696553389881126],
    [1.0, -1.745713902580108, 1.0, -1.7592330026643928, 0.9777533326389373],
    [0.738615833587383, -1.223190221090219, 0.738615833587383, -1.3664066228312026, 0.7794432948012946],
]);

/// [`LPF_AS_PRINTED`] divided by its gain at dc: the gain at dc of the rounded coefficients is
/// 1 to 3e-7 (at 60 Hz: 1.0013), and the whole response rises by 0.50 dB.
pub const LPF: Sos<4> = LPF_AS_PRINTED.with_unit_dc_gain();

/// "BPF" (Table 8): a 4th-order band pass around the injected 600 Hz.
///
/// At dc it attenuates by 40 dB only, so 1 % of the fundamental current passes: about the 10 mA that the
/// demodulation of the source evaluates.
#[rustfmt::skip]
pub const BPF: Sos<2> = Sos::from_f64(&[
    [0.23656651436594422, -0.4684576526448724, 0.23656651436594422, -1.6311003423569554, 0.8817519324689803],
    [0.09379053126985266, 0.06774457498501514, 0.09379053126985266, -1.3678961390655335, 0.8441402684907214],
]);

/// "PP" (Table 8): a 4th-order low pass, 100 Hz, after the demodulation.
#[rustfmt::skip]
pub const PP: Sos<2> = Sos::from_f64(&[
    [0.008951966550252578, -0.013874994329057859, 0.008951966550252578, -1.9091540566236969, 0.9131833315968833],
    [0.12063346987377434, -0.2304543334083907, 0.12063346987377434, -1.9552196000655901, 0.9666719379491434],
]);

/// State of [`LPF`] on a current vector.
pub type LpfState = SosState<AlphaBeta, 4>;
/// State of [`BPF`] on a current vector.
#[cfg(feature = "printed")]
pub type BpfState = SosState<AlphaBeta, 2>;
/// State of [`PP`] on the current difference.
#[cfg(feature = "printed")]
pub type PpState = SosState<f32, 2>;

const LPF_LAG: f32 = 1.530_412;
const LPF_LAG_SQUARED: f32 = 5.315_48;

/// Returns the phase delay of [`LPF`], samples, at `omega_t` rad/sample: 1.530412 + 5.31548 (ωT)². The
/// phase lag is this delay times `omega_t`.
///
/// It is a least-squares fit of the phase up to 60 Hz. The measured error of the phase is below
/// 0.0002° up to 60 Hz, 0.01° at 100 Hz, and 0.5° at 200 Hz. The function is even in `omega_t` and
/// defined for every value.
pub fn lpf_lag_samples(omega_t: f32) -> f32 {
    LPF_LAG + LPF_LAG_SQUARED * (omega_t * omega_t)
}
