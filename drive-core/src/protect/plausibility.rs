//! Plausibility of the current sensors: two checks without a third sensor.
//!
//! * [`CarrierWatch`]: both channels must show the carrier wherever the injection axis has a component
//!   along their axis. It detects an open or stuck channel.
//! * [`Prediction`]: the current must follow the applied voltage. The voltage unexplained by a first-order
//!   model of the motor and the back-emf of its rotor flux is filtered and must stay small. It detects a
//!   faulty sensor, an open phase, and a wrong angle or speed at speeds with a noticeable back-emf. Its mean in the frame
//!   of the flux detects a flux that is gone or elsewhere, from a back-emf of some 10 V on.

use core::f32::consts::TAU;

use crate::carrier::CarrierCurrent;
use crate::carrier::injection::CARRIER_SAMPLES;
use crate::fault::Fault;
use crate::io::PERIOD_S;
use crate::math::angle::UnitVector;
use crate::math::frames::{AlphaBeta, Dq, SQRT_3};
use crate::settings::Motor;
use crate::tuning::FirstOrder;

/// Share of the expected carrier amplitude below which a channel counts as silent.
const SILENT: f32 = 0.25;
/// Minimum component of the injection axis along the axis of a channel for a judgement.
const LEAST_SHARE: f32 = 0.4;
/// Consecutive silent carrier periods until the fault: 5 ms at 600 Hz.
const SILENT_PERIODS: u8 = 3;

/// Watch for the carrier in both current channels.
#[derive(Clone, Copy, Debug, Default)]
pub struct CarrierWatch {
    silent: [u8; 2],
    settled: u8,
}

impl CarrierWatch {
    /// Evaluates one carrier period: its carrier `current`, the injection `axis` in the stator frame, and
    /// the `expected` amplitude of the carrier current along that axis, A peak.
    ///
    /// # Errors
    /// [`Fault::CarrierMissingA`] or [`Fault::CarrierMissingB`] after three consecutive silent periods.
    pub fn step(
        &mut self,
        current: CarrierCurrent,
        axis: UnitVector,
        expected: f32,
    ) -> Result<(), Fault> {
        // Components along phases a and b: cos(theta) and cos(theta - 120°) of the injection axis, and
        // those of the axis 90° ahead of it.
        let phases = |x: f32, y: f32| [x, 0.5 * (SQRT_3 * y - x)];
        let along = phases(axis.cos, axis.sin);
        let across = phases(-axis.sin, axis.cos);
        // The first two carrier periods are not settled.
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
        if self.silent[0] >= SILENT_PERIODS {
            Err(Fault::CarrierMissingA)
        } else if self.silent[1] >= SILENT_PERIODS {
            Err(Fault::CarrierMissingB)
        } else {
            Ok(())
        }
    }
}

/// Coefficients of the comparison between measured and predicted current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Stator resistance of the settings, ohm.
    r_s: f32,
    /// 1/k of the current response, V/A.
    per_ampere: f32,
    /// Pole of the current response.
    pole: f32,
    /// Voltage along the rotor flux per magnetising current, by its decay, V/A.
    decay: f32,
    /// Back-emf across the rotor flux, V/A per electrical turn per period of the rotor.
    emf: f32,
    /// Allowed unexplained voltage at standstill, V peak.
    allowed: f32,
    /// Allowed mean of it in the frame of the flux, V peak.
    allowed_mean: f32,
}

/// Rotor flux in a sample. Frequencies in electrical turns per period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorFlux {
    /// Magnetising current, A.
    pub magnetising: f32,
    /// Speed of the rotor.
    pub rotor_freq: f32,
    /// Axis of the flux when the sampled current flowed, in the stator frame.
    pub axis: UnitVector,
    /// Frequency of the flux.
    pub flux_freq: f32,
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
    /// Axis of the flux in the middle of the samples, and its back-emf, V.
    flux: (UnitVector, f32),
    /// Mean unexplained voltage in the frame of the flux, V.
    pub mean: Dq,
}

/// Samples between two comparisons: half a carrier period. Over a whole one the carrier would average to
/// zero, but a faulty sensor would drive the current for twice as long.
const JUDGED_EVERY: usize = CARRIER_SAMPLES / 2;

/// Share of the newest value in the filtered unexplained voltage: 2.6 ms.
const SMOOTHING: f32 = 0.276;
/// Tolerated error of the expected back-emf as a share of it. 15° of angle error at 2 A make the flux 1.7
/// times the estimated one.
const EMF_SHARE: f32 = 1.0;
/// Share of the newest value in the mean in the frame of the flux: 50 ms.
const MEAN_SMOOTHING: f32 = JUDGED_EVERY as f32 * PERIOD_S / 0.050;
/// Tolerated share of the back-emf in that mean: a flux that is gone, or elsewhere, misses all of it.
const MEAN_EMF_SHARE: f32 = 0.5;

impl Prediction {
    /// Comparison for a motor with the current response `plant`, A/V, and an allowed unexplained voltage at
    /// standstill of `allowed_v`, V peak, and of `allowed_mean_v` in the mean of 50 ms.
    pub fn new(motor: &Motor, plant: FirstOrder, allowed_v: f32, allowed_mean_v: f32) -> Self {
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
        // Distance from here back to the middle of the samples.
        const MIDDLE: f32 = 0.5 * JUDGED_EVERY as f32 - 1.0;
        let axis = flux.axis.turned_slightly(-MIDDLE * flux.flux_freq);
        state.rotor = rotor.to_alpha_beta(axis);
        state.flux = (axis, self.emf * flux.magnetising * flux.flux_freq);
    }

    /// Compares the `current`, A, after it was [collected](PredictionState::collect); called in every fifth
    /// sample. The model of one period, `i[k] - p i[k-1] = k_g v[k-2]`, is averaged over the five. `resistance` is the
    /// deviation of the stator resistance from the settings, relative.
    ///
    /// # Errors
    /// [`Fault::CurrentNotAsPredicted`] when the unexplained voltage exceeds its limit, [`Fault::FluxNotAsPredicted`]
    /// when its mean in the frame of the flux does: the flux is not where, or not as large as, it is believed to be. At rest
    /// and without slip no voltage shows that.
    pub fn judge(
        &self,
        state: &mut PredictionState,
        current: AlphaBeta,
        resistance: f32,
    ) -> Result<(), Fault> {
        const MEAN: f32 = 1.0 / JUDGED_EVERY as f32;
        let changed = (current - state.last) * self.pole + state.currents * (1.0 - self.pole);
        let explained = changed * self.per_ampere + state.currents * (self.r_s * resistance);
        let unexplained = (explained - state.taken) * MEAN - state.rotor;
        state.unexplained += (unexplained - state.unexplained) * SMOOTHING;
        (state.last, state.currents) = (current, AlphaBeta::ZERO);
        // The two uncertainties are independent: their squares add.
        let allowed =
            self.allowed * self.allowed + EMF_SHARE * EMF_SHARE * state.rotor.length_squared();
        // NaN fails the comparison.
        let explained = state.unexplained.length_squared() <= allowed;
        if !explained {
            return Err(Fault::CurrentNotAsPredicted);
        }
        let (axis, emf) = state.flux;
        state.mean += (unexplained.to_dq(axis) - state.mean) * MEAN_SMOOTHING;
        let allowed = self.allowed_mean + MEAN_EMF_SHARE * emf.abs();
        let explained = state.mean.length_squared() <= allowed * allowed;
        if explained { Ok(()) } else { Err(Fault::FluxNotAsPredicted) }
    }
}

impl PredictionState {
    /// Adds one sample: the measured `current`, A, and the `computed` voltage of the same step, V, both in
    /// the stator frame.
    pub fn collect(&mut self, current: AlphaBeta, computed: AlphaBeta) {
        self.currents += current;
        self.voltages += computed;
    }

    /// Forgets what was unexplained so far: the model was that of another speed.
    pub fn forget(&mut self) {
        self.unexplained = AlphaBeta::ZERO;
        self.forget_mean();
    }

    /// Forgets the mean in the frame of the flux: the flux was not there.
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
mod tests {
    #![allow(clippy::disallowed_methods)] // std functions are the reference here
    use super::*;
    use crate::math::angle::Angle;
    use crate::math::frames::Abc;

    /// Carrier of 0.26 A, 30° behind its voltage, as sensors of these gains see it on the axis.
    fn seen(axis: UnitVector, gain_a: f32, gain_b: f32) -> CarrierCurrent {
        let component = |amplitude: f32| {
            let Abc { a, b, .. } = AlphaBeta::along(axis, amplitude).to_abc();
            AlphaBeta::from_two_phases(gain_a * a, gain_b * b).seen_from(axis)
        };
        let (re, im) = (component(0.26 * 0.866), component(-0.26 * 0.5));
        CarrierCurrent { along: (re.0, im.0), across: (re.1, im.1) }
    }

    /// The carrier period in which a fault shows, and the fault.
    fn watched(degrees: f32, gain_a: f32, gain_b: f32) -> Option<(usize, Fault)> {
        let axis = Angle::from_degrees(degrees).unit_vector();
        let mut watch = CarrierWatch::default();
        (1..100).find_map(|n| {
            watch.step(seen(axis, gain_a, gain_b), axis, 0.26).err().map(|fault| (n, fault))
        })
    }

    #[test]
    fn a_channel_below_a_quarter_of_its_carrier_is_silent() {
        // Two periods to settle, and three.
        let (a, b) = (Some((5, Fault::CarrierMissingA)), Some((5, Fault::CarrierMissingB)));
        for degrees in [60.0, -120.0, 64.0] {
            assert_eq!(watched(degrees, 1.0, 1.0), None);
            assert_eq!(watched(degrees, 0.26, 0.26), None);
            assert_eq!(watched(degrees, 0.24, 1.0), a, "{degrees}");
            assert_eq!(watched(degrees, 1.0, 0.24), b, "{degrees}");
            assert_eq!(watched(degrees, 0.0, 0.0), a, "{degrees}");
        }
        // Across its phase there is no carrier to be missed: 0.4 of it at 66.4°.
        for (degrees, judged) in [(90.0, false), (67.0, false), (66.0, true), (113.0, false)] {
            assert_eq!(watched(degrees, 0.0, 1.0).is_some(), judged, "{degrees}");
            assert_eq!(watched(120.0 - degrees, 1.0, 0.0).is_some(), judged, "{degrees}");
        }
        assert_eq!(watched(0.0, 1.0, 0.0), b);
    }

    #[test]
    fn a_channel_must_be_silent_in_a_row() {
        let axis = Angle::from_degrees(60.0).unit_vector();
        let mut watch = CarrierWatch::default();
        for n in 0..100 {
            let gain = if n % 3 == 0 { 1.0 } else { 0.0 };
            assert_eq!(watch.step(seen(axis, gain, gain), axis, 0.26), Ok(()));
        }
    }

    const PLANT: FirstOrder = FirstOrder { k: 0.003_205_2, p: 0.980_053 };
    /// Electrical turns per period: 600 and 630 rpm with two pole pairs.
    const ROTOR: f32 = 20.0 / 6000.0;
    const FLUX: f32 = 21.0 / 6000.0;

    /// Unexplained voltage, V, of the motor with its rotor at [`ROTOR`], an applied voltage that turns, and
    /// `more` volts along phase a that nobody knows of; and when the fault came. The drive believes
    /// `believed` of the speed of the rotor.
    fn unexplained(more: f32, believed: f32) -> (AlphaBeta, Option<u32>) {
        let motor = Motor::default();
        // The mean in the frame of the flux is not judged.
        let prediction = Prediction::new(&motor, PLANT, 15.0, 1e3);
        let (rest, fault) = run(&prediction, more, believed, 1.0);
        assert!(fault.is_none_or(|(_, fault)| fault == Fault::CurrentNotAsPredicted));
        (rest, fault.map(|(n, _)| n))
    }

    /// As [`unexplained`], with the fault; the motor has the share `flux` of the rotor flux that is believed.
    fn run(
        prediction: &Prediction,
        more: f32,
        believed: f32,
        flux: f32,
    ) -> (AlphaBeta, Option<(u32, Fault)>) {
        let motor = Motor::default();
        let (mut state, mut current) = (PredictionState::default(), AlphaBeta::ZERO);
        let (k_g, pole) = (PLANT.k as f32, PLANT.p as f32);
        let (mut acting, mut pending) = (AlphaBeta::ZERO, AlphaBeta::ZERO);
        let coupled = motor.coupled_inductance();
        let coupled = coupled * flux;
        let of_flux =
            Dq { d: coupled * 0.7 / motor.tau_r(), q: -coupled * 0.7 * ROTOR * TAU / PERIOD_S };
        for n in 0..3000_u32 {
            let axis = |k: f32| Angle::from_turns(k * FLUX % 1.0).unit_vector();
            state.collect(current, pending);
            match n % 10 {
                1 | 6 => state.latch_voltage(),
                2 | 7 => prediction.predict(
                    &mut state,
                    &RotorFlux {
                        magnetising: 0.7,
                        rotor_freq: believed * ROTOR,
                        axis: axis(n as f32),
                        flux_freq: FLUX,
                    },
                ),
                3 | 8 => {
                    if let Err(fault) = prediction.judge(&mut state, current, 0.0) {
                        return (state.unexplained, Some((n, fault)));
                    }
                }
                _ => {}
            }
            let emf = of_flux.to_alpha_beta(axis(n as f32 + 0.5));
            let total = acting + emf + AlphaBeta::new(more, 0.0);
            current = current * pole + total * k_g;
            acting = pending;
            pending = Dq::new(4.0, 20.0).to_alpha_beta(axis(n as f32 + 2.5));
        }
        (state.unexplained, None)
    }

    /// Back-emf of the rotor flux, V.
    fn emf() -> f32 {
        Motor::default().coupled_inductance() * 0.7 * TAU * 20.0
    }

    #[test]
    fn applied_voltage_and_rotor_explain_the_current() {
        let (rest, fault) = unexplained(0.0, 1.0);
        assert_eq!(fault, None);
        assert!(rest.length_squared() < 0.1 * 0.1, "{rest:?} of {}", emf());
        let (rest, fault) = unexplained(3.0, 1.0);
        assert!(fault.is_none() && (rest - AlphaBeta::new(3.0, 0.0)).length_squared() < 0.01);
    }

    #[test]
    fn a_flux_that_is_gone_is_seen_in_the_mean_of_its_voltage() {
        // The dissertation's motor: 12 V, and 6 V in the mean beside half of the back-emf of 13 V.
        let prediction = Prediction::new(&Motor::default(), PLANT, 12.0, 6.0);
        for (flux, seen) in [(1.0, false), (0.5, false), (0.0, true), (-1.0, true), (2.2, true)] {
            let (_, fault) = run(&prediction, 0.0, 1.0, flux);
            assert_eq!(fault.is_some(), seen, "{flux}: {fault:?} of {}", emf());
        }
        // 50 ms ln(1 / (1 - share)) with what is allowed as a share of the back-emf.
        let (_, fault) = run(&prediction, 0.0, 1.0, -0.2);
        let (n, fault) = fault.unwrap();
        assert_eq!(fault, Fault::FluxNotAsPredicted);
        let share = (6.0 + 0.5 * emf() * FLUX / ROTOR) / (1.2 * emf());
        let expected = -0.050 * 6000.0 * (1.0 - share).ln();
        assert!((n as f32 / expected - 1.0).abs() < 0.2, "{n} for {expected}");
    }

    #[test]
    fn voltage_beyond_the_allowed_one_and_the_back_emf_is_a_fault() {
        // The squares add: 15 V, and all of the back-emf.
        let most = (15.0 * 15.0 + emf() * emf()).sqrt();
        assert_eq!(unexplained(0.98 * most, 1.0).1, None);
        assert!(unexplained(1.02 * most, 1.0).1.is_some());
        // A speed believed at standstill leaves the back-emf unexplained, and does not widen the bound.
        let (rest, fault) = unexplained(0.0, 0.0);
        assert_eq!(fault.is_some(), emf() > 15.0);
        // A mean of 2.6 ms leaves 95 % of what turns at 21 Hz.
        assert!((rest.length_squared().sqrt() / emf() - 0.947).abs() < 0.01, "{rest:?}");
        assert!(unexplained(f32::NAN, 1.0).1.is_some());
    }
}
