//! The flux angle from the injected carrier: demodulation, reference, tracking.
//!
//! Any of the [demodulations](crate::demodulator) feeds one of two loops: that of the dissertation (a
//! reference of the current difference and the PII controller) or, behind the synchronous one, a
//! learned reference, scheduled gain and slip feed-forward.

use crate::angle::{Angle, UnitVector};
use crate::demodulator::{CarrierSample, Demodulate, Demodulator};
use crate::frames::AlphaBeta;
use crate::indirect::FluxAngle;
use crate::injection::CarrierPeriod;
use crate::learning::Learned;
use crate::schedule::{ReferenceTable, Schedule};
use crate::settings::Tracking;
use crate::synchronous::Saliency;
use crate::tracker::{Pll, Tracker, TrackerState};

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
        schedule: Schedule,
        /// What turns the axis.
        pll: Pll,
    },
}

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimator {
    /// What is made of the carrier current.
    pub demodulator: Tracking,
    /// Length of the rms filters of Ha and Sul, samples.
    pub rms_samples: u8,
    /// Current difference that an impedance difference of theirs stands for, A/ohm.
    pub ampere_per_ohm: f32,
    /// How the axis is turned by it.
    pub angle_loop: AngleLoop,
    /// Samples by which the current that is rotated lags the injection axis.
    pub lag: f32,
}

/// State.
#[derive(Clone, Copy, Debug, Default)]
pub struct EstimatorState {
    tracker: TrackerState,
    demodulator: Demodulator,
    /// Mean speed of the flux, turns per period, for the lag of the printed chain: the present one
    /// would feed the tracker's own steps back to it.
    mean_step: f32,
    /// Electrical speed of the rotor, turns per period.
    pub rotor_step: f32,
    /// Current difference that any but the synchronous demodulation sees, A.
    pub delta_i: f32,
    /// What the synchronous demodulation sees, as of the last sample [`SEEN_AT`].
    pub saliency: Saliency,
    /// What it says of the angle, rad, and the schedule's share of the proportional part.
    correction: (f32, f32),
}

/// Sample of the carrier period in which the averages of the synchronous demodulation are looked at.
/// Between, the loop of 4 Hz goes by what it saw last: 0.75 ms older, on average, beside the 3.2 ms of
/// the averages themselves.
pub const SEEN_AT: usize = 0;

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
        FluxAngle { phi: self.tracker.angle - Angle::QUARTER, step: self.tracker.step }
    }

    /// Whether everything is a finite number.
    pub fn is_finite(&self) -> bool {
        (self.tracker.step + self.mean_step + self.rotor_step + self.delta_i).is_finite()
    }
}

impl Estimator {
    /// Starts with the flux along phase a.
    pub fn start(&self, state: &mut EstimatorState) {
        let EstimatorState {
            tracker,
            demodulator,
            mean_step,
            rotor_step,
            delta_i,
            saliency,
            correction,
        } = state;
        // The tracker turns the axis of section 3.4, 90° ahead of the flux.
        *tracker = TrackerState::default();
        tracker.angle = Angle::QUARTER;
        demodulator.start(self.demodulator, self.rms_samples);
        (*mean_step, *rotor_step, *delta_i) = (0.0, 0.0, 0.0);
        (*saliency, *correction) = (Saliency::default(), (0.0, 0.0));
    }

    /// Compares with what was learned from now on.
    pub fn take(&mut self, learned: &Learned) {
        match &mut self.angle_loop {
            AngleLoop::Pii { reference, .. } => *reference = Reference::Learned(learned.reference),
            AngleLoop::Pll { schedule, .. } => {
                let b = learned.current_saliency;
                let b = b.accepted.then_some(b.value);
                *schedule = schedule.with(&learned.reference, b);
            }
        }
    }

    /// Demodulates one sample: the current, A; the injection axis, and how fast it turns, turns per
    /// period; the carrier; the reference of the quadrature current, A.
    #[inline]
    pub fn observe(
        &self,
        state: &mut EstimatorState,
        current: AlphaBeta,
        axis: UnitVector,
        step: f32,
        carrier: CarrierPeriod,
        i_q: f32,
    ) {
        let step = match self.demodulator {
            // These rotate what has passed the band-pass.
            Tracking::Literal | Tracking::Rectified => {
                state.mean_step += FLUX_SMOOTHING * (step - state.mean_step);
                state.mean_step
            }
            _ => step,
        };
        let axis = axis.turned_slightly(-step * self.lag);
        let sample = CarrierSample { current, axis, carrier, i_q };
        match &mut state.demodulator {
            Demodulator::Literal(d) => state.delta_i = d.step(&sample),
            Demodulator::Rectified(d) => state.delta_i = d.step(&sample),
            Demodulator::RmsImpedance(d) => state.delta_i = self.ampere_per_ohm * d.step(&sample),
            Demodulator::Envelope(d) => state.delta_i = d.step(&sample),
            Demodulator::Synchronous(d) => {
                let sums = d.average(&sample);
                if carrier.index == SEEN_AT {
                    state.saliency = Saliency::of(sums);
                    // By reference: the schedule is too large to copy.
                    if let AngleLoop::Pll { schedule, .. } = &self.angle_loop {
                        state.correction = schedule.correction(&state.saliency);
                    }
                }
            }
        }
    }

    /// Turns the axis on to the next sample by what was observed, with the reference of the
    /// quadrature current, A, and the slip, turns per period.
    ///
    /// # Errors
    /// [`Lost`] when the speed has reached its limit.
    #[inline]
    pub fn track(&self, state: &mut EstimatorState, i_q: f32, slip_step: f32) -> Result<(), Lost> {
        let held = match &self.angle_loop {
            AngleLoop::Pii { reference, tracker } => {
                let error = reference.at(i_q) - state.delta_i;
                let held = tracker.step(&mut state.tracker, error);
                let rotor_step = state.tracker.step - slip_step;
                state.rotor_step += ROTOR_SMOOTHING * (rotor_step - state.rotor_step);
                held
            }
            AngleLoop::Pll { pll, .. } => {
                let (error, share) = state.correction;
                pll.step(&mut state.tracker, &mut state.rotor_step, error, share, slip_step)
            }
        };
        if held { Ok(()) } else { Err(Lost) }
    }
}
