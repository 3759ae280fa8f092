//! Plausibility of the current sensors, by two checks that need no third sensor.
//!
//! * [`CarrierWatch`]: both channels must show the injection current if the injection axis has a
//!   component along their axis. It detects an open or stuck channel.
//! * [`Prediction`]: the current must follow the applied voltage. The voltage that a first-order model of the motor and
//!   the back-EMF of its rotor flux do not explain is filtered and must stay small. It detects a faulty sensor, an open
//!   phase, and a wrong angle or speed at speeds with a noticeable back-EMF. Its mean in the flux frame detects a flux
//!   that is missing or has another angle, with a back-EMF of about 10 V or more.

use core::f32::consts::TAU;

use crate::carrier::{CARRIER_SAMPLES, CarrierCurrent};
use crate::{AlphaBeta, Dq, Fault, FirstOrder, Motor, PERIOD_S, SQRT_3, UnitVector};

/// Share of the expected injection current below which a channel counts as silent.
const SILENT: f32 = 0.25;
/// Minimum component of the injection axis along the axis of a channel at which the channel is judged.
const LEAST_SHARE: f32 = 0.4;
/// Consecutive silent injection periods until the fault: 5 ms at 600 Hz.
const SILENT_PERIODS: u8 = 3;

/// Watch for the injection current in both current channels.
#[derive(Clone, Copy, Debug, Default)]
pub struct CarrierWatch {
    silent: [u8; 2],
    settled: u8,
}

impl CarrierWatch {
    /// Evaluates one injection period: its injection `current`, the injection `axis` in the stator frame,
    /// and the `expected` amplitude of the injection current along that axis, A peak.
    ///
    /// # Errors
    /// [`Fault::CarrierMissingA`] or [`Fault::CarrierMissingB`] after three consecutive silent periods.
    pub fn step(
        &mut self,
        current: CarrierCurrent,
        axis: UnitVector,
        expected: f32,
    ) -> Result<(), Fault> {
        // These are the components along phases a and b: cos(theta) and cos(theta - 120°) of the
        // injection axis, and the components of the axis 90° ahead of it.
        let phases = |x: f32, y: f32| [x, 0.5 * (SQRT_3 * y - x)];
        let along = phases(axis.cos, axis.sin);
        let across = phases(-axis.sin, axis.cos);
        // The first two injection periods are not settled.
        if self.settled < 2 {
            self.settled += 1;
            return Ok(());
        }
        for ((along, across), silent) in along.into_iter().zip(across).zip(&mut self.silent) {
            let re = along * current.along.0 + across * current.across.0;
            let im = along * current.along.1 + across * current.across.1;
            let due = SILENT * expected * along;
            let judged = along.abs() > LEAST_SHARE;
            let quiet = judged && re * re + im * im < due * due;
            *silent = if quiet { silent.saturating_add(1) } else { 0 };
        }
        Fault::CarrierMissingA.unless(self.silent[0] < SILENT_PERIODS)?;
        Fault::CarrierMissingB.unless(self.silent[1] < SILENT_PERIODS)
    }
}

/// Coefficients of the comparison between measured and predicted current.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Prediction {
    /// Stator resistance of the settings, ohm.
    r_s: f32,
    /// 1/k of the current response, V/A.
    per_ampere: f32,
    /// Pole of the current response.
    pole: f32,
    /// Voltage along the rotor flux per magnetising current, due to the decay of the flux, V/A.
    decay: f32,
    /// Back-EMF across the rotor flux, V/A per electrical turn per period of the rotor.
    emf: f32,
    /// Allowed unexplained voltage at standstill, V peak.
    allowed: f32,
    /// Allowed mean of the unexplained voltage in the flux frame, V peak: with the resistance of the start, and with a tracked one.
    allowed_mean: [f32; 2],
}

/// Rotor flux in a sample. Frequencies are in electrical turns per period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorFlux {
    /// Magnetising current, A.
    pub magnetising: f32,
    /// Speed of the rotor.
    pub rotor_freq: f32,
    /// Axis of the flux at the time when the sampled current flowed, in the stator frame.
    pub axis: UnitVector,
    /// Frequency of the flux.
    pub flux_freq: f32,
}

/// Knowledge of resistance and flux in a comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Uncertainty {
    /// Relative deviation of the stator resistance from the settings.
    pub deviation: f32,
    /// Whether the resistance is tracked; otherwise it is the resistance of the start.
    pub tracked: bool,
    /// Whether the flux of a rotating shaft builds up.
    pub building: bool,
}

/// State of the comparison.
#[derive(Clone, Copy, Debug, Default)]
pub struct PredictionState {
    /// Sum of the currents since the last comparison, A.
    currents: AlphaBeta,
    /// Current of the last comparison, A.
    last: AlphaBeta,
    /// Sum of the voltages since they were last latched, V.
    voltages: AlphaBeta,
    /// Latched sum of the voltages, V.
    taken: AlphaBeta,
    /// Expected mean rotor voltage between the comparisons, V.
    rotor: AlphaBeta,
    /// Filtered unexplained voltage, V.
    unexplained: AlphaBeta,
    /// Axis of the flux in the middle of the samples, and its back-EMF, V.
    flux: (UnitVector, f32),
    /// Mean unexplained voltage in the flux frame, V.
    mean: Dq,
}

/// Samples between two comparisons: half an injection period. Over a whole period the injection would
/// average to zero, but a faulty sensor would drive the current for twice as long.
const JUDGED_EVERY: usize = CARRIER_SAMPLES / 2;

/// Share of the newest value in the filtered unexplained voltage: 2.6 ms.
const SMOOTHING: f32 = 0.276;
/// Tolerated error of the expected back-EMF, as a share of it. With a larger share, a broken sensor drives the current for
/// longer at speed. A share of one half stopped no run of `full-range` that a share of one did not also stop, except flying
/// starts, whose flux is not yet as large as estimated. The second share is for these.
const EMF_SHARE: f32 = 0.5;
const EMF_SHARE_BUILDING: f32 = 1.0;
/// Share of the newest value in the mean in the flux frame: 50 ms.
const MEAN_SMOOTHING: f32 = JUDGED_EVERY as f32 * PERIOD_S / 0.050;
/// Tolerated share of the back-EMF in that mean. If the flux is missing or has another angle, the whole back-EMF is missing.
const MEAN_EMF_SHARE: f32 = 0.5;
/// Share of the back-EMF, and share of the allowed mean, that may be missing when the flux has built up without torque. In a frame that is
/// 2 Hz too fast or too slow, the whole back-EMF is missing. In correct starts a tenth is missing at 100 Hz, and a quarter at 350 Hz, where the
/// mean over the samples has an error of its own.
const MISSED_SHARE: f32 = 0.5;
const MISSED: f32 = 0.1;

impl Prediction {
    /// Creates the comparison for a motor with the current response `plant`, A/V. The allowed unexplained voltage at
    /// standstill is `allowed_v`, V peak, and in the mean of 50 ms `allowed_mean_v`: with the stator resistance of the
    /// start, and with a tracked one.
    pub fn new(motor: &Motor, plant: FirstOrder, allowed_v: f32, allowed_mean_v: [f32; 2]) -> Self {
        let coupled = motor.coupled_inductance();
        Self {
            r_s: motor.r_s,
            per_ampere: (1.0 / plant.k) as f32,
            pole: plant.p as f32,
            decay: coupled / motor.tau_r(),
            emf: coupled * TAU / PERIOD_S,
            allowed: allowed_v,
            allowed_mean: allowed_mean_v,
        }
    }

    /// Computes the rotor voltage, V, that adds to the applied one, (L_m/L_r)(1/tau_r - j w_r) psi; called
    /// one sample before [`judge`](Self::judge).
    pub fn predict(&self, state: &mut PredictionState, flux: &RotorFlux) {
        let rotor = Dq {
            d: self.decay * flux.magnetising,
            q: -self.emf * flux.magnetising * flux.rotor_freq,
        };
        // This is the distance from the present sample back to the middle of the samples.
        const MIDDLE: f32 = 0.5 * JUDGED_EVERY as f32 - 1.0;
        let axis = flux.axis.turned_slightly(-MIDDLE * flux.flux_freq);
        state.rotor = rotor.to_alpha_beta(axis);
        state.flux = (axis, self.emf * flux.magnetising * flux.flux_freq);
    }

    /// Whether the mean of the unexplained voltage is small enough for a flux that rotates with the frame. Without such a flux the
    /// whole back-EMF is missing.
    pub fn sees_flux(&self, state: &PredictionState) -> bool {
        let (_, emf) = state.flux;
        let missing = if emf < 0.0 { -state.mean.q } else { state.mean.q };
        missing <= MISSED_SHARE * emf.abs() + MISSED * self.allowed_mean[1]
    }

    /// Compares the `current`, A, with its prediction, after the current was collected; called in
    /// every fifth sample. The model of one period, `i[k] - p i[k-1] = k_g v[k-2]`, is averaged
    /// over the five.
    ///
    /// # Errors
    /// [`Fault::CurrentNotAsPredicted`] when the unexplained voltage exceeds its limit, [`Fault::FluxNotAsPredicted`] when
    /// its mean in the flux frame does, because the flux does not have the estimated angle or magnitude. At rest and without
    /// slip no voltage shows that.
    pub fn judge(
        &self,
        state: &mut PredictionState,
        current: AlphaBeta,
        known: Uncertainty,
    ) -> Result<(), Fault> {
        const MEAN: f32 = 1.0 / JUDGED_EVERY as f32;
        let changed = (current - state.last) * self.pole + state.currents * (1.0 - self.pole);
        let explained = changed * self.per_ampere + state.currents * (self.r_s * known.deviation);
        let unexplained = (explained - state.taken) * MEAN - state.rotor;
        state.unexplained += (unexplained - state.unexplained) * SMOOTHING;
        (state.last, state.currents) = (current, AlphaBeta::ZERO);
        // The two uncertainties are independent, so their squares add.
        let share = if known.building { EMF_SHARE_BUILDING } else { EMF_SHARE };
        let allowed = self.allowed * self.allowed + share * share * state.rotor.length_squared();
        Fault::CurrentNotAsPredicted.unless(state.unexplained.length_squared() <= allowed)?;
        let (axis, emf) = state.flux;
        state.mean += (unexplained.to_dq(axis) - state.mean) * MEAN_SMOOTHING;
        let allowed = self.allowed_mean[usize::from(known.tracked)] + MEAN_EMF_SHARE * emf.abs();
        Fault::FluxNotAsPredicted.unless(state.mean.length_squared() <= allowed * allowed)
    }
}

impl PredictionState {
    /// Adds one sample: the measured `current`, A, and the `computed` voltage of the same step, V, both in
    /// the stator frame.
    pub fn collect(&mut self, current: AlphaBeta, computed: AlphaBeta) {
        self.currents += current;
        self.voltages += computed;
    }

    /// Resets the unexplained voltage, because the model was used with another speed.
    pub fn forget(&mut self) {
        self.unexplained = AlphaBeta::ZERO;
        self.forget_mean();
    }

    /// Resets the mean in the flux frame, because there was no established flux.
    pub fn forget_mean(&mut self) {
        self.mean = Dq::ZERO;
    }

    /// Latches the sum of the voltages; called two samples before [`Prediction::judge`]. The voltage
    /// computed in a sample acts from the next sample to the one after, and so determines the current two
    /// samples later.
    pub fn latch_voltage(&mut self) {
        self.taken = core::mem::replace(&mut self.voltages, AlphaBeta::ZERO);
    }
}

#[cfg(test)]
mod tests;
