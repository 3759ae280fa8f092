//! The flux angle from the injected carrier: demodulation, reference, tracking.
//!
//! Any of the [demodulations](crate::carrier::demodulator) feeds one of two loops: that of the dissertation (a
//! reference of the current difference and the PII controller) or, behind the synchronous one, a
//! learned reference, scheduled gain and slip feed-forward.

use crate::carrier::demodulator::{Demodulate, Demodulator};
use crate::carrier::synchronous::SynchronousState;
use crate::carrier::{CarrierSample, DemodulatorKind, Saliency};
use crate::flux::indirect::FluxAngle;
use crate::flux::schedule::GainSchedule;
use crate::flux::tracker::{Pll, Push, Tracker, TrackerState};
use crate::math::angle::Angle;
use crate::settings::table::ReferenceTable;

/// `ref_delta_i` over i_q: odd, constant from a certain current on, linear below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantReference {
    /// Value from there on, A.
    pub full: f32,
    /// Slope below, A/A.
    pub slope: f32,
    /// Where it becomes constant, A.
    pub from: f32,
}

impl ConstantReference {
    /// Reference of the current difference, A.
    fn at(&self, i_q: f32) -> f32 {
        if i_q > self.from {
            self.full
        } else if i_q < -self.from {
            -self.full
        } else {
            self.slope * i_q
        }
    }
}

/// What the current difference is compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// Section 3.3.
    Constant(ConstantReference),
    /// Learned over i_q, A.
    Learned(ReferenceTable),
}

impl Reference {
    /// Reference of the current difference, A.
    fn at(&self, i_q: f32) -> f32 {
        match self {
            Self::Constant(constant) => constant.at(i_q),
            Self::Learned(table) => table.at(i_q),
        }
    }
}

/// How the axis is turned by what was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AngleLoop {
    /// Section 3.11.
    Pii {
        /// What the current difference is compared with.
        reference: Reference,
        /// What turns the axis.
        tracker: Tracker,
    },
    /// Behind the synchronous demodulation.
    Pll {
        /// What the saliency is compared with.
        schedule: GainSchedule,
        /// What turns the axis.
        pll: Pll,
    },
}

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimator {
    /// What is made of the carrier current.
    pub demodulator: DemodulatorKind,
    /// Length of the rms filters of Ha and Sul, samples.
    pub rms_samples: u8,
    /// Current difference that an impedance difference of theirs stands for, A/ohm.
    pub ampere_per_ohm: f32,
    /// How the axis is turned by it.
    pub angle_loop: AngleLoop,
    /// Samples by which the sampled carrier current lags the injection axis.
    pub lag: f32,
    /// The same of the band-pass, for the demodulations that rotate behind it.
    pub band_pass_lag: f32,
}

/// State.
// In this order: the large one that is hardly used comes last.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub struct EstimatorState {
    tracker: TrackerState,
    /// The carrier current, and what the synchronous demodulation sees.
    pub synchronous: SynchronousState,
    /// Mean speed of the flux, turns per period, for the lag of the printed chain: the present one
    /// would feed the tracker's own steps back to it.
    mean_freq: f32,
    /// Electrical speed of the rotor, turns per period.
    pub rotor_freq: f32,
    /// Current difference that any but the synchronous demodulation sees, A.
    pub delta_i: f32,
    /// Which way the synchronous demodulation pushes the axis, by what it saw last. That is 1.1 ms older,
    /// on average, than what the averages themselves delay by 3.2 ms: little for a loop of 4 Hz.
    push: Push,
    demodulator: Demodulator,
}

/// Share of the newest value in the mean speed of the flux: 50 ms.
const FLUX_SMOOTHING: f32 = 1.0 / 300.0;
/// Share of the newest value in the mean speed of the rotor: 5 ms.
const ROTOR_SMOOTHING: f32 = 1.0 / 30.0;

/// The tracker ran away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lost;

impl EstimatorState {
    /// The flux angle at the present sample.
    pub fn flux(&self) -> FluxAngle {
        FluxAngle { phi: self.tracker.angle - Angle::QUARTER, freq: self.tracker.freq }
    }

    /// Whether everything is a finite number.
    pub fn is_finite(&self) -> bool {
        (self.tracker.freq + self.mean_freq + self.rotor_freq + self.delta_i).is_finite()
            && self.synchronous.seen.q.is_finite()
    }

    /// What the synchronous demodulation sees; nothing where it does not track.
    pub fn saliency(&self) -> &Saliency {
        &self.synchronous.seen
    }
}

impl Estimator {
    /// Starts with the flux along phase a.
    pub fn start(&self, state: &mut EstimatorState) {
        let EstimatorState {
            tracker,
            demodulator,
            mean_freq,
            rotor_freq,
            delta_i,
            synchronous,
            push,
        } = state;
        // The tracker turns the axis of section 3.4, 90° ahead of the flux.
        *tracker = TrackerState::default();
        tracker.angle = Angle::QUARTER;
        demodulator.start(self.demodulator, self.rms_samples);
        (*mean_freq, *rotor_freq, *delta_i) = (0.0, 0.0, 0.0);
        (*synchronous, *push) = (SynchronousState::default(), Push::default());
    }

    /// Replaces the reference by a learned one, and the saliency per ampere of stator current, 1/A,
    /// where one was learned.
    pub fn take(&mut self, learned: &ReferenceTable, current_saliency: Option<f32>) {
        match &mut self.angle_loop {
            AngleLoop::Pii { reference, .. } => *reference = Reference::Learned(*learned),
            AngleLoop::Pll { schedule, .. } => {
                *schedule = schedule.with(learned, current_saliency);
            }
        }
    }

    /// Demodulates one sample: the current, A; the injection axis, delayed by [`lag`](Self::lag), and how
    /// fast it turns, turns per period; the carrier; the reference of the quadrature current, A.
    pub fn observe(&self, state: &mut EstimatorState, sample: &CarrierSample, step: f32) {
        state.synchronous.mix(sample);
        if let AngleLoop::Pii { .. } = self.angle_loop {
            self.observe_printed(state, *sample, step);
        }
    }

    /// Once a carrier period, where the synchronous demodulation tracks: the saliency that the one before shows.
    pub fn see(&self, state: &mut EstimatorState) {
        if let AngleLoop::Pll { .. } = self.angle_loop {
            state.synchronous.see();
        }
    }

    /// Once a carrier period, with the saliency of the one before: which way the axis is pushed by it. An
    /// acceleration of the rotor that is asked for is known, turns per period in each.
    pub fn push(&self, state: &mut EstimatorState, acceleration: f32) {
        if let AngleLoop::Pll { schedule, pll } = &self.angle_loop {
            let (error, share) = schedule.correction(state.saliency());
            state.push = pll.push(error, share, acceleration);
        }
    }

    /// The other demodulations.
    fn observe_printed(&self, state: &mut EstimatorState, mut sample: CarrierSample, step: f32) {
        if let Demodulator::Literal(_) | Demodulator::Rectified(_) = state.demodulator {
            // These rotate what has passed the band-pass.
            state.mean_freq += FLUX_SMOOTHING * (step - state.mean_freq);
            sample.axis = sample.axis.turned_slightly(-state.mean_freq * self.band_pass_lag);
        }
        state.delta_i = match &mut state.demodulator {
            Demodulator::Literal(d) => d.step(&sample),
            Demodulator::Rectified(d) => d.step(&sample),
            Demodulator::RmsImpedance(d) => self.ampere_per_ohm * d.step(&sample),
            Demodulator::Envelope(d) => d.step(&sample),
        };
    }

    /// Turns the axis on to the next sample by what was observed, with the reference of the
    /// quadrature current, A, and the slip, turns per period.
    ///
    /// # Errors
    /// [`Lost`] when the speed has reached its limit.
    pub fn track(&self, state: &mut EstimatorState, i_q: f32, slip_freq: f32) -> Result<(), Lost> {
        match &self.angle_loop {
            AngleLoop::Pii { reference, tracker } => {
                let error = reference.at(i_q) - state.delta_i;
                let held = tracker.step(&mut state.tracker, error);
                let rotor_freq = state.tracker.freq - slip_freq;
                state.rotor_freq += ROTOR_SMOOTHING * (rotor_freq - state.rotor_freq);
                if held { Ok(()) } else { Err(Lost) }
            }
            AngleLoop::Pll { .. } => {
                Pll::step(&mut state.tracker, &mut state.rotor_freq, state.push, slip_freq);
                Ok(())
            }
        }
    }
}

#[cfg(test)]
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

    /// The loop turns the axis by reference less difference; the rotor is what turns beside the slip.
    #[test]
    fn the_rotor_is_the_flux_less_the_slip() {
        let (estimator, mut state) = (pii(0.1), EstimatorState::default());
        estimator.start(&mut state);
        assert_eq!(state.flux(), FluxAngle { phi: Angle::ZERO, freq: 0.0 });
        state.delta_i = 0.015;
        estimator.track(&mut state, 2.0, 0.0).unwrap();
        assert!(state.flux().freq < 0.0, "the difference is beyond its reference");
        // At the reference the speed stays.
        state.delta_i = 0.01;
        estimator.track(&mut state, 2.0, 0.0).unwrap();
        let freq = state.flux().freq;
        for _ in 0..600 {
            estimator.track(&mut state, 2.0, 1e-3).unwrap();
        }
        assert_eq!(state.flux().freq, freq);
        assert!((state.rotor_freq - (freq - 1e-3)).abs() < 1e-7, "{}", state.rotor_freq);
        // By 5 ms, 30 periods: 63 % of a step.
        for _ in 0..30 {
            estimator.track(&mut state, 2.0, 0.0).unwrap();
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
        assert!((0..1000).any(|_| estimator.track(&mut state, 2.0, 0.0) == Err(Lost)));
    }

    /// Difference that is seen of a carrier that is larger along dm than along qm, on an axis that turns.
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
        // 300 rpm with two pole pairs.
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
