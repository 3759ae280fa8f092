//! Sensorless flux angle from the injection: demodulation, saliency offset, tracking.
//!
//! Each [demodulator](crate::carrier::demodulator) feeds one of two loops: the loop of the dissertation
//! (reference of the current difference and PII controller) or, for the synchronous demodulation, the
//! [filter](super::angle_filter) with a learned saliency offset and slip feed-forward.

use crate::carrier::demodulator::Demodulator;
use crate::carrier::synchronous::{AVERAGES_LAG, SynchronousState};
use crate::carrier::{Asymmetry, CarrierSample, DemodulatorKind, Saliency};
use crate::flux::angle_filter::{AngleFilter, AngleFilterState, Correction};
use crate::flux::hand_over::Turning;
use crate::flux::indirect::FluxAngle;
use crate::flux::observer::SeenSpeed;
use crate::flux::schedule::GainSchedule;
use crate::flux::tracker::{Tracker, TrackerState};
use crate::learned::Learned;
use crate::table::ReferenceTable;
use crate::{Angle, UnitVector};

/// Reference `ref_delta_i` over i_q (section 3.3): odd, linear up to the current `from`, constant beyond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantReference {
    /// Value above `from`, A.
    pub full: f32,
    /// Slope below `from`, A/A.
    pub slope: f32,
    /// Q-axis current above which the reference is constant, A.
    pub from: f32,
}

/// Reference of the current difference over i_q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// Reference as printed, section 3.3.
    Constant(ConstantReference),
    /// Learned table, A.
    Learned(ReferenceTable),
}

impl Reference {
    /// Returns the reference of the current difference at `i_q`, both A.
    fn at(&self, i_q: f32) -> f32 {
        match self {
            Self::Learned(table) => table.at(i_q),
            Self::Constant(constant) if i_q > constant.from => constant.full,
            Self::Constant(constant) if i_q < -constant.from => -constant.full,
            Self::Constant(constant) => constant.slope * i_q,
        }
    }
}

/// Angle-tracking loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AngleLoop {
    /// PII controller of section 3.11, for all demodulators except the synchronous one.
    Pii {
        /// Reference of the current difference.
        reference: Reference,
        /// Controller of the injection axis.
        tracker: Tracker,
    },
    /// Filter for the synchronous demodulation.
    Filter {
        /// Saliency offset and saliency sensitivity over i_q.
        schedule: GainSchedule,
        /// Filter of the flux angle.
        filter: AngleFilter,
        /// Learned asymmetry of sensors and stator.
        asymmetry: Asymmetry,
    },
}

/// Coefficients of the estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimator {
    /// The selected demodulator.
    pub demodulator: DemodulatorKind,
    /// Length of the rms filters of the impedance demodulator, samples.
    pub rms_samples: u8,
    /// Current difference equivalent to an impedance difference of that demodulator, A/ohm.
    pub ampere_per_ohm: f32,
    /// The tracking loop.
    pub angle_loop: AngleLoop,
    /// Lag of the sampled injection current behind the injection axis, samples.
    pub lag: f32,
    /// Additional lag of the band-pass, samples, for demodulators that rotate after it.
    pub band_pass_lag: f32,
}

/// State of the estimator.
// The large demodulator, which is seldom used, comes last, so that all other fields stay within reach of one base address.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub struct EstimatorState {
    tracker: TrackerState,
    /// State of the synchronous demodulation, which always runs.
    pub synchronous: SynchronousState,
    /// Mean frequency of the flux, electrical turns per period, for the lag of the printed chain. The
    /// present frequency would feed the tracker's corrections back to it.
    mean_freq: f32,
    /// Electrical speed of the rotor, turns per period.
    pub rotor_freq: f32,
    /// Output of the selected demodulator as a current difference, A; 0 with the synchronous one.
    pub delta_i: f32,
    /// Lasting angle error from the latest saliency, flux less estimate, rad.
    pub angle_error: f32,
    /// Correction per period from the latest saliency. It is held for an injection period, which adds 1.1
    /// ms on average to the 3.2 ms delay of the averages, little for a loop of 4 Hz.
    correction: Correction,
    /// State of the filter.
    pub filter: AngleFilterState,
    /// Asymmetry beyond the learned one that this start and the starts before have found.
    pub changed: Asymmetry,
    demodulator: Demodulator,
}

/// Share of the newest value in the mean frequency of the flux: 50 ms.
const FLUX_SMOOTHING: f32 = 1.0 / 300.0;
/// Share of the newest value in the mean speed of the rotor: 5 ms.
const ROTOR_SMOOTHING: f32 = 1.0 / 30.0;

/// The flux angle is lost: the tracker has reached its speed limit, or turned by NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrackingLost;

impl EstimatorState {
    /// Returns the estimated flux angle at the present sample.
    pub fn flux(&self) -> FluxAngle {
        FluxAngle { phi: self.tracker.angle - Angle::QUARTER, freq: self.tracker.freq }
    }

    /// Lets the axis rotate with a rotor of this speed, electrical turns per period.
    pub fn preset_speed(&mut self, rotor_freq: f32) {
        (self.rotor_freq, self.tracker.freq) = (rotor_freq, rotor_freq);
    }

    /// Whether all state variables of the loop are finite.
    pub fn is_finite(&self) -> bool {
        (self.tracker.freq + self.mean_freq + self.rotor_freq + self.delta_i).is_finite()
            && self.synchronous.saliency.q.is_finite()
    }

    /// Returns the result of the synchronous demodulation. `q` stays 0 if another demodulator tracks.
    pub fn saliency(&self) -> &Saliency {
        &self.synchronous.saliency
    }
}

impl Estimator {
    /// Resets `state` to a flux along phase a, at standstill.
    pub fn start(&self, state: &mut EstimatorState) {
        let EstimatorState {
            tracker,
            demodulator,
            mean_freq,
            rotor_freq,
            delta_i,
            synchronous,
            correction,
            filter,
            angle_error,
            changed: _,
        } = state;
        // The tracker turns the axis of section 3.4, 90° ahead of the flux.
        *tracker = TrackerState::default();
        tracker.angle = Angle::QUARTER;
        demodulator.start(self.demodulator, self.rms_samples);
        (*mean_freq, *rotor_freq, *delta_i) = (0.0, 0.0, 0.0);
        (*synchronous, *correction) = (SynchronousState::default(), Correction::default());
        *filter = AngleFilterState::default();
        *angle_error = 0.0;
    }

    /// Takes an accepted result of a self-commissioning.
    pub fn take(&mut self, learned: &Learned) {
        match &mut self.angle_loop {
            AngleLoop::Pii { reference, .. } => *reference = Reference::Learned(learned.reference),
            AngleLoop::Filter { schedule, asymmetry, .. } => {
                *schedule = schedule.with_learned(&learned.reference, learned.slope.as_ref());
                *asymmetry = learned.asymmetry;
            }
        }
    }

    /// Demodulates one sample, whose axis is delayed by [`lag`](Self::lag); called in every control
    /// period. `flux_freq` is the frequency of the axis, electrical turns per period.
    pub fn observe(&self, state: &mut EstimatorState, sample: &CarrierSample, flux_freq: f32) {
        state.synchronous.mix(sample);
        if let AngleLoop::Pii { .. } = self.angle_loop {
            self.demodulate(state, *sample, flux_freq);
        }
    }

    /// Computes the saliency of the previous injection period, if the synchronous demodulation tracks; called once per
    /// injection period, after its last sample. `axis` is the injection axis of the present sample, delayed by
    /// [`lag`](Self::lag), `flux_freq` its frequency, electrical turns per period.
    pub fn update_saliency(&self, state: &mut EstimatorState, axis: UnitVector, flux_freq: f32) {
        if let AngleLoop::Filter { asymmetry, .. } = &self.angle_loop {
            let synchronous = &mut state.synchronous;
            synchronous.update_saliency();
            let seen = axis.turned_slightly(-flux_freq * AVERAGES_LAG);
            asymmetry.plus(&state.changed, 1.0).take_out(&mut synchronous.saliency, seen);
        }
    }

    /// Begins an injection period of the filter, see [`AngleFilter`].
    pub fn predict_flux(&self, state: &mut EstimatorState) {
        if let AngleLoop::Filter { filter, .. } = &self.angle_loop {
            filter.predict_flux(&mut state.filter, state.rotor_freq);
        }
    }

    /// Continues the injection period of the filter, with a q-axis current reference `i_q`, A, and the share of a deviation of the stator
    /// resistance that decays in an injection period.
    pub fn predict(&self, state: &mut EstimatorState, i_q: f32, resistance_decay: f32) {
        state.filter.follow(i_q);
        if let AngleLoop::Filter { filter, .. } = &self.angle_loop {
            filter.predict(&mut state.filter, resistance_decay);
        }
    }

    /// Takes the speed that the observer has `seen` in the injection period.
    pub fn see_speed(&self, state: &mut EstimatorState, seen: &SeenSpeed) {
        if let AngleLoop::Filter { filter, .. } = &self.angle_loop {
            // This is the tracked speed at the time of the observed speed.
            let tracked = state.rotor_freq - state.tracker.acceleration * seen.age;
            filter.see_speed(&mut state.filter, seen, seen.rotor_freq - tracked);
        }
    }

    /// Computes the corrections from the saliency of the previous injection period, if the filter tracks the angle; called once
    /// per injection period. `known` is the rotor's acceleration reference, electrical turns per period squared, which is fed
    /// forward. Returns the correction of the relative stator resistance.
    #[inline(always)] // out of line, 48 bytes more of control code and 18 cycles
    pub fn update_correction(&self, state: &mut EstimatorState, filters: bool, known: f32) -> f32 {
        let AngleLoop::Filter { schedule, filter, .. } = &self.angle_loop else { return 0.0 };
        let saliency = &state.synchronous.saliency;
        let point = schedule.at(saliency.i_q);
        let deviation = saliency.q - point.reference;
        state.angle_error = point.lasting * deviation;
        let (correction, resistance) = if filters {
            filter.see_carrier(&mut state.filter, point.gain * deviation, point.gain)
        } else {
            (Correction::default(), 0.0)
        };
        state.correction = Correction { speed: correction.speed + known, ..correction };
        resistance
    }

    /// Runs the selected demodulator, if it is not the synchronous one.
    #[cold]
    fn demodulate(&self, state: &mut EstimatorState, mut sample: CarrierSample, flux_freq: f32) {
        if state.demodulator.rotates_output() {
            state.mean_freq += FLUX_SMOOTHING * (flux_freq - state.mean_freq);
            sample.axis = sample.axis.turned_slightly(-state.mean_freq * self.band_pass_lag);
        }
        state.delta_i = state.demodulator.step(&sample, self.ampere_per_ohm);
    }

    /// Advances the injection axis to the next sample; called in every control period. `i_q` is the
    /// q-axis current reference, A, `slip_freq` the slip, electrical turns per period.
    ///
    /// # Errors
    /// `TrackingLost` when the PII tracker has reached its speed limit, or the other loop has turned by NaN. (The drive
    /// itself checks the speed of the other loop.)
    #[inline(always)] // runs in every period, with its values in registers
    pub fn track(
        &self,
        state: &mut EstimatorState,
        i_q: f32,
        slip_freq: f32,
        turning: &Turning,
    ) -> Result<(), TrackingLost> {
        let EstimatorState { tracker: axis, rotor_freq, correction, delta_i, .. } = state;
        let held = match &self.angle_loop {
            AngleLoop::Pii { reference, tracker } => {
                let held = tracker.step(axis, reference.at(i_q) - *delta_i);
                *rotor_freq += ROTOR_SMOOTHING * (axis.freq - slip_freq - *rotor_freq);
                held
            }
            AngleLoop::Filter { .. } => axis.step(rotor_freq, correction, slip_freq, turning),
        };
        if held { Ok(()) } else { Err(TrackingLost) }
    }
}

#[cfg(all(test, feature = "printed"))]
mod tests {
    use super::*;

    #[test]
    fn the_constant_reference_follows_the_sign_of_the_torque_current() {
        let reference = ConstantReference { full: 0.01, slope: 0.02, from: 0.5 };
        for (i_q, expected) in [(0.0, 0.0), (0.25, 0.005), (0.5, 0.01), (3.0, 0.01)] {
            assert!((Reference::Constant(reference).at(i_q) - expected).abs() < 1e-8);
            assert!((Reference::Constant(reference).at(-i_q) + expected).abs() < 1e-8);
        }
    }

    fn pii(limit: f32) -> Estimator {
        Estimator {
            demodulator: DemodulatorKind::Envelope,
            rms_samples: 10,
            ampere_per_ohm: 1.0,
            angle_loop: AngleLoop::Pii {
                reference: Reference::Constant(ConstantReference {
                    full: 0.01,
                    slope: 0.02,
                    from: 0.5,
                }),
                tracker: Tracker::new(0.13, 0.9, limit),
            },
            lag: 0.0,
            band_pass_lag: 0.0,
        }
    }

    /// The loop rotates the axis by reference less difference. The speed of the rotor is the speed of the axis less the slip.
    #[test]
    fn the_rotor_is_the_flux_less_the_slip() {
        let (estimator, mut state) = (pii(0.1), EstimatorState::default());
        estimator.start(&mut state);
        assert_eq!(state.flux(), FluxAngle { phi: Angle::ZERO, freq: 0.0 });
        state.delta_i = 0.015;
        estimator.track(&mut state, 2.0, 0.0, &Turning::default()).unwrap();
        assert!(state.flux().freq < 0.0, "the difference is beyond its reference");
        // At the reference the speed does not change.
        state.delta_i = 0.01;
        estimator.track(&mut state, 2.0, 0.0, &Turning::default()).unwrap();
        let freq = state.flux().freq;
        for _ in 0..600 {
            estimator.track(&mut state, 2.0, 1e-3, &Turning::default()).unwrap();
        }
        assert_eq!(state.flux().freq, freq);
        assert!((state.rotor_freq - (freq - 1e-3)).abs() < 1e-7, "{}", state.rotor_freq);
        // After 5 ms, 30 periods, the mean has reached 63 % of a step.
        for _ in 0..30 {
            estimator.track(&mut state, 2.0, 0.0, &Turning::default()).unwrap();
        }
        let share = (state.rotor_freq - (freq - 1e-3)) / 1e-3;
        assert!((share - 0.638).abs() < 0.005, "{share}");
        assert!(state.is_finite());
    }

    #[test]
    fn a_tracker_that_runs_away_is_lost() {
        let (estimator, mut state) = (pii(1e-3), EstimatorState::default());
        estimator.start(&mut state);
        state.delta_i = -1.0;
        assert!((0..1000).any(
            |_| estimator.track(&mut state, 2.0, 0.0, &Turning::default()) == Err(TrackingLost)
        ));
    }

    /// Returns the measured difference of an injection current that is larger along dm than along qm, on a rotating axis.
    fn difference(demodulator: DemodulatorKind, step: f32, band_pass_lag: f32, scale: f32) -> f32 {
        let estimator = Estimator { demodulator, band_pass_lag, ampere_per_ohm: scale, ..pii(0.1) };
        let mut state = EstimatorState::default();
        estimator.start(&mut state);
        let mut mean = 0.0;
        for k in 0..4000 {
            let axis = Angle::from_turns((k as f32 * step) % 1.0).unit_vector();
            let carrier = Angle::from_turns((k % 10) as f32 / 10.0).unit_vector();
            let [dm, qm] = [0.20, 0.17].map(|amplitude: f32| amplitude * carrier.cos);
            let along = axis.turned_by(Angle::from_degrees(-45.0).unit_vector());
            let across = axis.turned_by(Angle::from_degrees(45.0).unit_vector());
            let current = crate::math::frames::AlphaBeta::along(along, dm)
                + crate::math::frames::AlphaBeta::along(across, qm);
            let carrier = crate::carrier::injection::CarrierPeriod {
                voltage: 50.0 * carrier.cos,
                cos: carrier.cos,
                sin: carrier.sin,
                ..Default::default()
            };
            estimator.observe(&mut state, &CarrierSample { current, axis, carrier }, step);
            mean += if k < 3000 { 0.0 } else { state.delta_i / 1000.0 };
        }
        mean
    }

    #[test]
    fn the_lag_of_the_band_pass_is_made_up_for() {
        // The axis rotates at 300 rpm with two pole pairs.
        let step = 10.0 / 6000.0;
        let seen = |step, lag| difference(DemodulatorKind::Rectified, step, lag, 1.0);
        let standing = seen(0.0, 0.0);
        assert_eq!(seen(0.0, 8.83), standing, "at standstill nothing lags");
        assert!((seen(step, 8.83) / standing - 1.0).abs() < 0.03);
        assert!((seen(step, 0.0) / standing - 1.0).abs() > 0.3);
    }

    #[test]
    fn an_impedance_difference_counts_by_its_scale() {
        let [one, two] =
            [1.0, 2.0].map(|scale| difference(DemodulatorKind::RmsImpedance, 0.0, 0.0, scale));
        assert!(one.abs() > 1.0 && (two / one - 2.0).abs() < 1e-5, "{one} {two}");
        let kind = DemodulatorKind::Envelope;
        assert_eq!(difference(kind, 0.0, 0.0, 2.0), difference(kind, 0.0, 0.0, 1.0));
    }
}
