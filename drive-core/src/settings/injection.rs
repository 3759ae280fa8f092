//! The injection and the tracking of the angle.

use super::value::words;
use crate::carrier::DemodulatorKind;
use crate::settings::table::{CarrierTable, ReferenceTable};

/// Tracking loop of sections 3.4 and 3.11, for all demodulators but the synchronous one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrintedChain {
    /// `ref_delta_i`, A (section 3.3): reference of the current difference from
    /// [`full_reference_iq_a`](Self::full_reference_iq_a) on. It must be odd in i_q, so it follows
    /// the sign of i_q, and goes through zero linearly.
    pub reference_a: f32,
    /// Current on the quadrature axis from which on the reference is full, A; unset: by rule.
    pub full_reference_iq_a: Option<f32>,
    /// Gain k_s of the tracker, rad/A (Eq. 3.44).
    pub k_s: f32,
    /// Zero z_s of the tracker (Eq. 3.44).
    pub z_s: f32,
    /// Reference of the current difference over the torque current, A, learned with the shaft locked;
    /// replaces the constant one.
    pub learned: Option<ReferenceTable>,
    /// Length of the rms filters of [`DemodulatorKind::RmsImpedance`], samples.
    pub rms_samples: u8,
}

impl Default for PrintedChain {
    /// Sections 3.3 and 3.11; two carrier periods.
    fn default() -> Self {
        Self {
            reference_a: 0.010,
            full_reference_iq_a: None,
            k_s: 0.132_546,
            z_s: 0.90,
            learned: None,
            rms_samples: 20,
        }
    }
}

/// Synchronous demodulation and its loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SynchronousTracking {
    /// Natural frequency of the tracking loop, Hz.
    pub bandwidth_hz: f32,
    /// Saliency fixed to the flux at the nominal magnetising current, until the slope is learned. Negative: the
    /// inductance along the flux is the larger one.
    pub flux_saliency: f32,
    /// Saliency per ampere of stator current, 1/A, for the gain schedule; unset: by rule.
    pub current_saliency: Option<f32>,
    /// Reference of the saliency over the torque current, learned with the shaft locked; unset: guessed.
    pub reference: Option<ReferenceTable>,
    /// Whether a drive that has not learned its motor starts without an encoder: for motors whose saliency is known from
    /// elsewhere, as that of a model.
    pub allow_unlearned: bool,
    /// Whether a start checks the saliency of the motor (see [`crate::protect::saliency_check`]). Without
    /// the check a start assumes it, and a shaft at standstill.
    pub check: bool,
    /// Whether the lock is verified at a start and watched (see [`crate::protect::lock_monitor`]).
    pub monitor: bool,
    /// Carrier current over the torque current, learned with the shaft locked, for the monitor; unset: guessed.
    pub carrier: Option<CarrierTable>,
    /// Allowed loss of the lock monitor: missing share of the flux-fixed saliency; 1 is zero flux.
    pub allowed_loss: f32,
    /// Time constant of the mean loss, s.
    pub loss_s: f32,
    /// Mechanical speed that trips, rpm, the end of the range in which the angle is tracked; unset: by rule.
    pub tracked_rpm: Option<f32>,
}

impl Default for SynchronousTracking {
    fn default() -> Self {
        Self {
            bandwidth_hz: 3.5,
            flux_saliency: -0.035,
            current_saliency: None,
            reference: None,
            allow_unlearned: false,
            check: true,
            monitor: true,
            carrier: None,
            allowed_loss: 0.55,
            loss_s: 0.12,
            tracked_rpm: None,
        }
    }
}

/// The injection and the tracking of the angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InjectionSettings {
    /// Amplitude of the injected voltage, V peak, 0 for none; unset: by rule.
    pub amplitude_v: Option<f32>,
    /// Demodulation of the carrier current.
    pub demodulator: DemodulatorKind,
    /// Settings of the chain of the dissertation.
    pub printed: PrintedChain,
    /// Settings of the synchronous demodulation.
    pub synchronous: SynchronousTracking,
    /// Inject and demodulate also while the angle comes from the encoder.
    pub beside_encoder: bool,
}

impl Default for InjectionSettings {
    /// 50 V (28 % of the largest voltage) is an assumption; the dissertation gives no amplitude.
    fn default() -> Self {
        Self {
            amplitude_v: None,
            demodulator: DemodulatorKind::default(),
            printed: PrintedChain::default(),
            synchronous: SynchronousTracking::default(),
            beside_encoder: false,
        }
    }
}

words!(DemodulatorKind {
    Self::Literal => DemodulatorKind::Literal, "literal";
    Self::Rectified => DemodulatorKind::Rectified, "rectified";
    Self::Synchronous => DemodulatorKind::Synchronous, "synchronous";
    Self::RmsImpedance => DemodulatorKind::RmsImpedance, "rms-impedance";
    Self::Envelope => DemodulatorKind::Envelope, "envelope";
});
