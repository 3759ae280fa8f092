//! The loop of the dissertation, and the choice between it and the filter.

use super::{Demodulator, DemodulatorKind, PrintedSettings, Tracker};
use crate::carrier::CarrierSample;
use crate::flux::{AngleLoop, Axis, FilterLoop, Turning};
use crate::learned::Learned;

/// Share of the newest value in the mean frequency of the flux: 50 ms.
const FLUX_SMOOTHING: f32 = 1.0 / 300.0;
/// Share of the newest value in the mean speed of the rotor: 5 ms.
const ROTOR_SMOOTHING: f32 = 1.0 / 30.0;

/// State of the loop of the dissertation.
#[derive(Clone, Copy, Debug, Default)]
pub struct PrintedState {
    /// Mean frequency of the flux, electrical turns per period, for the lag of the printed chain. The
    /// present frequency would feed the tracker's corrections back to it.
    mean_freq: f32,
    /// Output of the demodulator as a current difference, A.
    pub delta_i: f32,
    /// Error of the previous period, A.
    error: f32,
    demodulator: Demodulator,
}

/// The loop that the setting `injection.demodulator` selects.
// A drive has a single one, so the size of the smaller variant does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ComparedLoop {
    /// Synchronous demodulation and filter.
    Filter(FilterLoop),
    /// The loop of sections 3.3, 3.4 and 3.11: a demodulator, a reference of its current difference, and the PII controller.
    Printed(PrintedSettings),
}

impl PrintedSettings {
    /// Returns the reference of the current difference at `i_q`, both A (section 3.3): odd, linear up to a current, constant beyond.
    fn reference(&self, i_q: f32) -> f32 {
        let (full, from) = self.reference_a;
        match &self.learned {
            Some(table) => table.at(i_q),
            None if i_q > from => full,
            None if i_q < -from => -full,
            None => full / from * i_q,
        }
    }

    /// Demodulates one sample.
    #[cold]
    fn demodulate(&self, state: &mut PrintedState, mut sample: CarrierSample, flux_freq: f32) {
        if state.demodulator.rotates_output() {
            state.mean_freq += FLUX_SMOOTHING * (flux_freq - state.mean_freq);
            sample.axis = sample.axis.turned_slightly(-state.mean_freq * self.band_pass_lag);
        }
        state.delta_i = state.demodulator.step(&sample, self.ampere_per_ohm);
    }

    /// Turns the axis until the current difference equals its reference.
    fn track(&self, state: &mut PrintedState, axis: &mut Axis, i_q: f32, slip_freq: f32) -> bool {
        let error = self.reference(i_q) - state.delta_i;
        let tracker = Tracker::new(self.k_s, self.z_s, self.limit);
        let held = tracker.step(axis, &mut state.error, error);
        axis.rotor_freq += ROTOR_SMOOTHING * (axis.freq - slip_freq - axis.rotor_freq);
        held
    }
}

impl AngleLoop for ComparedLoop {
    type State = PrintedState;

    fn of(filter: FilterLoop, printed: &PrintedSettings) -> Self {
        match printed.demodulator {
            DemodulatorKind::Synchronous => Self::Filter(filter),
            _ => Self::Printed(*printed),
        }
    }

    fn filter(&self) -> Option<&FilterLoop> {
        match self {
            Self::Filter(filter) => Some(filter),
            Self::Printed(_) => None,
        }
    }

    fn tracks(&self) -> bool {
        !matches!(self, Self::Printed(printed) if !printed.demodulator.tracks())
    }

    fn take(&mut self, learned: &Learned) {
        match self {
            Self::Filter(filter) => filter.take(learned),
            Self::Printed(printed) => printed.learned = Some(learned.reference),
        }
    }

    fn start(&self, state: &mut PrintedState) {
        let PrintedState { mean_freq, delta_i, error, demodulator } = state;
        (*mean_freq, *delta_i, *error) = (0.0, 0.0, 0.0);
        match self {
            Self::Filter(_) => demodulator.start(DemodulatorKind::Synchronous, 0),
            Self::Printed(printed) => demodulator.start(printed.demodulator, printed.rms_samples),
        }
    }

    fn observe(&self, state: &mut PrintedState, sample: &CarrierSample, flux_freq: f32) {
        if let Self::Printed(printed) = self {
            printed.demodulate(state, *sample, flux_freq);
        }
    }

    fn delta_i(state: &PrintedState) -> f32 {
        state.delta_i
    }

    #[inline(always)] // runs in every period, with its values in registers
    fn track(
        &self,
        state: &mut PrintedState,
        axis: &mut Axis,
        i_q: f32,
        slip_freq: f32,
        turning: &Turning,
    ) -> bool {
        match self {
            Self::Filter(_) => axis.step(slip_freq, turning),
            Self::Printed(printed) => printed.track(state, axis, i_q, slip_freq),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Angle;

    #[test]
    fn the_constant_reference_follows_the_sign_of_the_torque_current() {
        for (i_q, expected) in [(0.0, 0.0), (0.25, 0.005), (0.5, 0.01), (3.0, 0.01)] {
            assert!((pii(0.1).reference(i_q) - expected).abs() < 1e-8);
            assert!((pii(0.1).reference(-i_q) + expected).abs() < 1e-8);
        }
    }

    fn pii(limit: f32) -> PrintedSettings {
        PrintedSettings {
            demodulator: DemodulatorKind::Envelope,
            rms_samples: 10,
            ampere_per_ohm: 1.0,
            band_pass_lag: 0.0,
            reference_a: (0.01, 0.5),
            learned: None,
            k_s: 0.13,
            z_s: 0.9,
            limit,
        }
    }

    /// The loop rotates the axis by reference less difference. The speed of the rotor is the speed of the axis less the slip.
    #[test]
    fn the_rotor_is_the_flux_less_the_slip() {
        let (mut state, mut axis) = (PrintedState::default(), Axis::default());
        let mut track = |state: &mut PrintedState, slip: f32| {
            assert!(pii(0.1).track(state, &mut axis, 2.0, slip));
            axis
        };
        state.delta_i = 0.015;
        assert!(track(&mut state, 0.0).freq < 0.0, "the difference is beyond its reference");
        // At the reference the speed does not change.
        state.delta_i = 0.01;
        let freq = track(&mut state, 0.0).freq;
        let axis = (0..600).map(|_| track(&mut state, 1e-3)).last().unwrap();
        assert_eq!(axis.freq, freq);
        assert!((axis.rotor_freq - (freq - 1e-3)).abs() < 1e-7, "{}", axis.rotor_freq);
        // After 5 ms, 30 periods, the mean has reached 63 % of a step.
        let axis = (0..30).map(|_| track(&mut state, 0.0)).last().unwrap();
        let share = (axis.rotor_freq - (freq - 1e-3)) / 1e-3;
        assert!((share - 0.638).abs() < 0.005, "{share}");
    }

    #[test]
    fn a_tracker_that_runs_away_is_lost() {
        let mut state = PrintedState { delta_i: -1.0, ..PrintedState::default() };
        let mut axis = Axis::default();
        assert!((0..1000).any(|_| !pii(1e-3).track(&mut state, &mut axis, 2.0, 0.0)));
    }

    /// Returns the measured difference of an injection current that is larger along dm than along qm, on a rotating axis.
    fn difference(demodulator: DemodulatorKind, step: f32, band_pass_lag: f32, scale: f32) -> f32 {
        let pii = PrintedSettings { demodulator, band_pass_lag, ampere_per_ohm: scale, ..pii(0.1) };
        let (pii, mut state) = (ComparedLoop::Printed(pii), PrintedState::default());
        pii.start(&mut state);
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
            pii.observe(&mut state, &CarrierSample { current, axis, carrier }, step);
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
