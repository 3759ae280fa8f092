//! Quantities of a step that the drive shows.

use core::mem::offset_of;

use super::{Drive, Phase};
use crate::{AlphaBeta, Angle, AngleLoop, Dq};

/// Measured, estimated and applied quantities of the last step, as 32-bit words in this order: a debugger reads them from
/// memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Telemetry {
    /// Estimated rotor-flux angle at the sample.
    pub phi: Angle,
    /// Frequency of the flux, electrical turns per period.
    pub flux_freq: f32,
    /// Electrical speed of the rotor, turns per period.
    pub rotor_freq: f32,
    /// Filtered current reference, A.
    pub reference: Dq,
    /// Filtered current in the estimated flux frame, A.
    pub current: Dq,
    /// Wanted voltage without the injection, V.
    pub voltage: Dq,
    /// Measured current in the stator frame, A, unfiltered, so it contains the injection current.
    pub measured: AlphaBeta,
    /// Voltage of the period that begins with the next sample, limited, without the dead-time
    /// compensation, V.
    pub realised: AlphaBeta,
    /// Current difference from a demodulation other than the synchronous one, A.
    pub delta_i: f32,
    /// Saliency from the synchronous demodulation.
    pub saliency: f32,
    /// Square of the injection current along the injection axis, A^2.
    pub carrier_squared: f32,
    /// Share of the injected voltage that is applied, below 1 if the fundamental leaves too little voltage.
    pub carrier_share: f32,
    /// Saliency deficit of the lock monitor: the missing share of the flux-fixed saliency; 1 means no flux.
    pub saliency_loss: f32,
    /// Dc-link voltage, V.
    pub dc_link: f32,
    /// Inverter voltage error per phase beyond the dead time, as measured at the start, V.
    pub inverter_drop: f32,
    /// Position in mechanical turns from the start; without the encoder it drifts, see
    /// `motion`.
    pub turns: f32,
}

impl Telemetry {
    /// Returns the telemetry without current, with the full injection.
    pub(super) fn still() -> Self {
        Self { carrier_share: 1.0, ..Self::default() }
    }
}

/// Limits of the present torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TorqueLimits {
    /// Least and largest q-axis current, A, at the present speed, dc link and heat-sink temperature; only while the drive
    /// regulates.
    pub i_q: (f32, f32),
    /// Reduction of the largest q-axis current by the heat-sink temperature, A.
    pub thermal_reduction_a: f32,
    /// Voltage that the limit of the d-axis current uses, V peak; 0 if the d-axis current is that
    /// of the setting.
    pub voltage: f32,
}

impl<L: AngleLoop> Drive<L> {
    /// Position of the [telemetry](Self::telemetry) in a drive, bytes.
    #[doc(hidden)]
    pub const TELEMETRY: usize = offset_of!(Self, kept.seen);

    /// Returns the limits of the present torque.
    pub fn torque_limits(&self) -> TorqueLimits {
        let limits = &self.kept.limits;
        let (i_q, voltage) = (limits.now.i_q, limits.voltage.available);
        TorqueLimits { i_q, thermal_reduction_a: limits.thermal_reduction_a, voltage }
    }

    /// Returns the telemetry of the last step with the outputs on.
    pub const fn telemetry(&self) -> &Telemetry {
        &self.kept.seen
    }

    /// Returns the tracked stator resistance relative to the settings, less one; only while an observer tracks it.
    pub fn stator_resistance(&self) -> Option<f32> {
        match &self.phase {
            Phase::Field(field) if self.c.observer.is_some() && field.has_torque() => {
                Some(field.observer.resistance.now)
            }
            _ => None,
        }
    }
}
