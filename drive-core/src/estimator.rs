//! The flux angle from the injected carrier: demodulation, reference, tracking.
//!
//! One type for the two ways of doing it: the chain of the dissertation (filters, difference, PII
//! controller, constant reference) and the synchronous one (normalised demodulation, learned
//! reference, scheduled gain, slip feed-forward).

use crate::angle::Angle;
use crate::demodulator::{Demodulator, DemodulatorState};
use crate::frames::AlphaBeta;
use crate::indirect::FluxAngle;
use crate::learning::Learned;
use crate::schedule::{ReferenceTable, Schedule};
use crate::synchronous::{Saliency, SynchronousState};
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

/// What the current difference is compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PrintedReference {
    /// The constant of section 3.3.
    Constant(ConstantReference),
    /// Learned over i_q, A.
    Learned(ReferenceTable),
}

impl PrintedReference {
    fn at(&self, i_q: f32) -> f32 {
        match self {
            Self::Constant(reference) => reference.at(i_q),
            Self::Learned(table) => table.at(i_q),
        }
    }
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

/// How the angle is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Sections 3.4 and 3.11.
    Printed {
        /// How the difference is taken.
        demodulator: Demodulator,
        /// What it is compared with.
        reference: PrintedReference,
        /// What turns the axis.
        tracker: Tracker,
    },
    /// See [`crate::synchronous`].
    Synchronous {
        /// What the saliency is compared with.
        schedule: Schedule,
        /// What turns the axis.
        pll: Pll,
    },
}

/// Coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimator {
    /// How the angle is found.
    pub method: Method,
    /// Samples by which the current that is demodulated lags the injection axis.
    pub lag: f32,
}

/// State.
#[derive(Clone, Copy, Debug, Default)]
pub struct EstimatorState {
    tracker: TrackerState,
    printed: DemodulatorState,
    synchronous: SynchronousState,
    /// Mean speed of the flux, turns per period, for the lag of the printed chain: the present one
    /// would feed the tracker's own steps back to it.
    mean_step: f32,
    /// Electrical speed of the rotor, turns per period.
    pub rotor_step: f32,
    /// Current difference of the printed chain, A.
    pub delta_i: f32,
    /// What the synchronous demodulation sees.
    pub saliency: Saliency,
}

/// Share of the newest value in the mean speed of the flux: 50 ms.
const FLUX_SMOOTHING: f32 = 1.0 / 300.0;
/// Share of the newest value in the mean speed of the rotor: 5 ms.
const ROTOR_SMOOTHING: f32 = 1.0 / 30.0;

/// The tracker ran away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lost;

impl EstimatorState {
    /// Starts with the flux along phase a: the injection axis 90° ahead.
    pub fn start(&mut self) {
        *self = Self::default();
        self.tracker.angle = Angle::QUARTER;
    }

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
    /// Compares with what was learned from now on.
    pub fn take(&mut self, learned: &Learned) {
        match &mut self.method {
            Method::Printed { reference, .. } => {
                *reference = PrintedReference::Learned(learned.reference);
            }
            Method::Synchronous { schedule, .. } => {
                let b = learned.current_saliency;
                let b = b.accepted.then_some(b.value);
                *schedule = schedule.with(&learned.reference, b);
            }
        }
    }

    /// Demodulates one sample: the current, A; the injection axis and how fast it turns, turns per
    /// period; the number of the sample in the carrier period; the reference of the quadrature
    /// current, A.
    pub fn observe(
        &self,
        state: &mut EstimatorState,
        current: AlphaBeta,
        theta: FluxAngle,
        carrier: usize,
        i_q: f32,
    ) {
        let dm_axis = |step: f32| {
            (theta.phi - Angle::EIGHTH - Angle::within_turn(step * self.lag)).unit_vector()
        };
        match self.method {
            Method::Printed { demodulator, .. } => {
                state.mean_step += FLUX_SMOOTHING * (theta.step - state.mean_step);
                let axis = dm_axis(state.mean_step);
                state.delta_i = demodulator.step(&mut state.printed, current, axis);
            }
            Method::Synchronous { .. } => {
                state.saliency = state.synchronous.step(current, dm_axis(theta.step), carrier, i_q);
            }
        }
    }

    /// Turns the axis on to the next sample by what was observed, with the reference of the
    /// quadrature current, A, and the slip, turns per period.
    ///
    /// # Errors
    /// [`Lost`] when the speed has reached its limit.
    pub fn track(&self, state: &mut EstimatorState, i_q: f32, slip_step: f32) -> Result<(), Lost> {
        let held = match self.method {
            Method::Printed { reference, tracker, .. } => {
                let error = reference.at(i_q) - state.delta_i;
                let held = tracker.step(&mut state.tracker, error);
                let rotor_step = state.tracker.step - slip_step;
                state.rotor_step += ROTOR_SMOOTHING * (rotor_step - state.rotor_step);
                held
            }
            Method::Synchronous { schedule, pll } => {
                let (reference, share) = schedule.at(state.saliency.i_q);
                let error = schedule.per_saliency * (reference - state.saliency.q);
                pll.step(&mut state.tracker, &mut state.rotor_step, error, share, slip_step)
            }
        };
        if held { Ok(()) } else { Err(Lost) }
    }
}
