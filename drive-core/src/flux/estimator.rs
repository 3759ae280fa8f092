//! Sensorless flux angle from the injection: demodulation, saliency offset, tracking.
//!
//! A drive is generic over the loop that turns the injection axis, an [`AngleLoop`]. The [default](FilterLoop) is the synchronous
//! demodulation and the [filter](super::angle_filter) with a learned saliency offset and slip feed-forward; the loop of the
//! dissertation is in [`printed`](crate::printed).

use core::fmt::Debug;

use crate::carrier::synchronous::{AVERAGES_LAG, SynchronousState};
use crate::carrier::{Asymmetry, CarrierSample, Saliency};
use crate::flux::angle_filter::{AngleFilter, AngleFilterState, Correction};
use crate::flux::hand_over::Turning;
use crate::flux::indirect::FluxAngle;
use crate::flux::printed_settings::PrintedSettings;
use crate::flux::schedule::GainSchedule;
use crate::flux::tracker::Axis;
use crate::learned::Learned;
use crate::{Angle, UnitVector};

/// A loop that turns the injection axis so that it follows the flux. Its settings are `self`.
///
/// The synchronous demodulation runs beside every loop. A loop with a [`filter`](Self::filter) is corrected by it once an injection
/// period; any other loop demodulates by itself in [`observe`](Self::observe).
pub trait AngleLoop: Copy + Debug + PartialEq {
    /// State beside that of the filter.
    type State: Copy + Debug + Default;

    /// Returns the loop with these settings, of which it takes its own.
    fn of(filter: FilterLoop, printed: &PrintedSettings) -> Self;
    /// Returns the filter that corrects the axis; `None` if the loop does without.
    fn filter(&self) -> Option<&FilterLoop>;
    /// Whether the axis follows the flux, so that the drive can learn and run with it.
    fn tracks(&self) -> bool {
        true
    }
    /// Takes an accepted result of a self-commissioning.
    fn take(&mut self, learned: &Learned);
    /// Resets `state`.
    fn start(&self, _state: &mut Self::State) {}
    /// Demodulates one sample by itself; called in every control period. `flux_freq` is the frequency of the axis, electrical turns
    /// per period.
    fn observe(&self, _state: &mut Self::State, _sample: &CarrierSample, _flux_freq: f32) {}
    /// Returns the output of its own demodulation as a current difference, A; 0 if it has none.
    fn delta_i(_state: &Self::State) -> f32 {
        0.0
    }
    /// Advances the axis to the next sample; called in every control period. `i_q` is the q-axis current reference, A, `slip_freq` the
    /// slip, electrical turns per period. Returns false if the angle is lost.
    fn track(
        &self,
        state: &mut Self::State,
        axis: &mut Axis,
        i_q: f32,
        slip_freq: f32,
        turning: &Turning,
    ) -> bool;
}

/// The loop of the synchronous demodulation.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FilterLoop {
    /// Saliency offset and saliency sensitivity over i_q.
    pub schedule: GainSchedule,
    /// Filter of the flux angle.
    pub filter: AngleFilter,
    /// Learned asymmetry of sensors and stator.
    pub asymmetry: Asymmetry,
}

impl AngleLoop for FilterLoop {
    type State = ();

    fn of(filter: FilterLoop, _: &PrintedSettings) -> Self {
        filter
    }

    fn filter(&self) -> Option<&FilterLoop> {
        Some(self)
    }

    fn take(&mut self, learned: &Learned) {
        self.schedule = self.schedule.with_learned(&learned.reference, learned.slope.as_ref());
        self.asymmetry = learned.asymmetry;
    }

    #[inline(always)] // runs in every period, with its values in registers
    fn track(&self, (): &mut (), axis: &mut Axis, _: f32, slip_freq: f32, t: &Turning) -> bool {
        axis.step(slip_freq, t)
    }
}

/// Coefficients of the estimator.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Estimator<L> {
    /// The loop that turns the injection axis.
    pub angle_loop: L,
    /// Lag of the sampled injection current behind the injection axis, samples.
    pub lag: f32,
    /// Sign of the demodulated saliency: 1 with the injection across the flux, -1 along it, where both components of the saliency have
    /// the opposite sign.
    pub sign: f32,
}

/// State of the estimator, with the state `S` of its loop.
// The state of the loop, which may be large and is seldom used, comes last, so that all other fields stay within reach of one base
// address.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub struct EstimatorState<S> {
    /// The injection axis.
    pub axis: Axis,
    /// State of the synchronous demodulation, which always runs.
    pub synchronous: SynchronousState,
    /// Lasting angle error from the latest saliency, flux less estimate, rad.
    pub angle_error: f32,
    /// State of the filter.
    pub filter: AngleFilterState,
    /// Asymmetry beyond the learned one that this start and the starts before have found.
    pub changed: Asymmetry,
    own: S,
}

impl<S> EstimatorState<S> {
    /// Returns the estimated flux angle at the present sample.
    pub fn flux(&self) -> FluxAngle {
        FluxAngle { phi: self.axis.angle - Angle::QUARTER, freq: self.axis.freq }
    }

    /// Lets the axis rotate with a rotor of this speed, electrical turns per period.
    pub fn preset_speed(&mut self, rotor_freq: f32) {
        (self.axis.rotor_freq, self.axis.freq) = (rotor_freq, rotor_freq);
    }

    /// Returns the result of the synchronous demodulation. `q` stays 0 in a loop without the filter.
    pub fn saliency(&self) -> &Saliency {
        &self.synchronous.saliency
    }
}

/// State of an estimator with the loop `L`.
type State<L> = EstimatorState<<L as AngleLoop>::State>;

impl<L: AngleLoop> Estimator<L> {
    /// Resets `state` to a flux along phase a, at standstill.
    pub fn start(&self, state: &mut State<L>) {
        let EstimatorState { axis, synchronous, angle_error, filter, changed: _, own } = state;
        // The axis of section 3.4 is 90° ahead of the flux.
        *axis = Axis { angle: Angle::QUARTER, ..Axis::default() };
        *synchronous = SynchronousState::default();
        *filter = AngleFilterState::default();
        *angle_error = 0.0;
        self.angle_loop.start(own);
    }

    /// Whether all state variables of the loop are finite.
    pub fn is_finite(&self, state: &State<L>) -> bool {
        (state.axis.freq + state.axis.rotor_freq + self.delta_i(state)).is_finite()
            && state.synchronous.saliency.q.is_finite()
    }

    /// Returns the output of the loop's own demodulation as a current difference, A; 0 with the synchronous one.
    pub fn delta_i(&self, state: &State<L>) -> f32 {
        L::delta_i(&state.own)
    }

    /// Demodulates one sample, whose axis is delayed by [`lag`](Self::lag); called in every control
    /// period. `flux_freq` is the frequency of the axis, electrical turns per period.
    pub fn observe(&self, state: &mut State<L>, sample: &CarrierSample, flux_freq: f32) {
        state.synchronous.mix(sample);
        self.angle_loop.observe(&mut state.own, sample, flux_freq);
    }

    /// Computes the saliency of the previous injection period, if the synchronous demodulation tracks; called once per
    /// injection period, after its last sample. `axis` is the injection axis of the present sample, delayed by
    /// [`lag`](Self::lag), `flux_freq` its frequency, electrical turns per period.
    pub fn update_saliency(&self, state: &mut State<L>, axis: UnitVector, flux_freq: f32) {
        if let Some(FilterLoop { asymmetry, .. }) = self.angle_loop.filter() {
            let synchronous = &mut state.synchronous;
            synchronous.update_saliency();
            let seen = axis.turned_slightly(-flux_freq * AVERAGES_LAG);
            asymmetry.plus(&state.changed, 1.0).take_out(&mut synchronous.saliency, seen);
        }
    }

    /// Runs a part of an injection period of the filter, if the loop has one.
    pub fn run(
        &self,
        state: &mut State<L>,
        part: impl FnOnce(&AngleFilter, &mut AngleFilterState, &Axis),
    ) {
        if let Some(FilterLoop { filter, .. }) = self.angle_loop.filter() {
            part(filter, &mut state.filter, &state.axis);
        }
    }

    /// Computes the corrections from the saliency of the previous injection period, if the filter tracks the angle; called once
    /// per injection period. `known` is the rotor's acceleration reference, electrical turns per period squared, which is fed
    /// forward. Returns the correction of the relative stator resistance.
    #[inline(always)] // out of line, 48 bytes more of control code and 18 cycles
    pub fn update_correction(&self, state: &mut State<L>, filters: bool, known: f32) -> f32 {
        let Some(FilterLoop { schedule, filter, .. }) = self.angle_loop.filter() else {
            return 0.0;
        };
        let saliency = &state.synchronous.saliency;
        let point = schedule.at(saliency.i_q);
        let deviation = self.sign * saliency.q - point.reference;
        state.angle_error = point.lasting * deviation;
        let (correction, resistance) = if filters {
            filter.see_carrier(&mut state.filter, point.gain * deviation, point.gain)
        } else {
            (Correction::default(), 0.0)
        };
        state.axis.correction = Correction { speed: correction.speed + known, ..correction };
        resistance
    }

    /// Advances the injection axis to the next sample; called in every control period. `i_q` is the
    /// q-axis current reference, A, `slip_freq` the slip, electrical turns per period.
    ///
    /// Returns false if the angle is lost: the PII tracker has reached its speed limit, or the other loop has turned by NaN. (The drive
    /// itself checks the speed of the other loop.)
    #[inline(always)] // runs in every period, with its values in registers
    pub fn track(&self, state: &mut State<L>, i_q: f32, slip_freq: f32, turning: &Turning) -> bool {
        self.angle_loop.track(&mut state.own, &mut state.axis, i_q, slip_freq, turning)
    }
}
