//! Do the current sensors tell the truth? Two checks that need no third sensor.
//!
//! * The carrier must be seen by both channels, wherever the injection axis has a component along
//!   the axis of the channel: finds an open or stuck channel.
//! * The current must follow the applied voltage: the voltage that a first-order model of the motor
//!   and the back-emf of its rotor flux cannot explain is filtered and must stay small. That finds
//!   a sensor that lies, an open phase, and an angle or speed that is wrong while the rotor turns
//!   fast enough for its back-emf to stand out.

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
/// Least share of the injection along the axis of a channel for the channel to be judged.
const LEAST_SHARE: f32 = 0.4;
/// Carrier periods in a row that a channel must be silent: 5 ms at 600 Hz.
const SILENT_PERIODS: u8 = 3;

/// Watches for the carrier in both channels.
#[derive(Clone, Copy, Debug, Default)]
pub struct CarrierWatch {
    silent: [u8; 2],
    settled: u8,
}

impl CarrierWatch {
    /// Once a carrier period: the carrier current in it, the injection axis, and the amplitude of the
    /// carrier current expected along it, A.
    ///
    /// # Errors
    /// A channel does not see it.
    pub fn step(
        &mut self,
        seen: CarrierCurrent,
        axis: UnitVector,
        expected: f32,
    ) -> Result<(), Fault> {
        // Of the axes: what of the injection lies along phases a and b, cos(theta) and cos(theta - 120°);
        // and of what lies 90° ahead of it.
        let phases = |x: f32, y: f32| [x, 0.5 * (SQRT_3 * y - x)];
        let along = phases(axis.cos, axis.sin);
        let across = phases(-axis.sin, axis.cos);
        // The first two carrier periods are not settled.
        if self.settled < 2 {
            self.settled += 1;
            return Ok(());
        }
        for ((along, across), silent) in along.into_iter().zip(across).zip(&mut self.silent) {
            let re = along * seen.along.0 + across * seen.across.0;
            let im = along * seen.along.1 + across * seen.across.1;
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

/// Coefficients of the comparison of measured and predicted current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// 1/k of the motor, V/A.
    per_ampere: f32,
    /// Pole of the motor.
    pole: f32,
    /// What the rotor flux of 1 A of magnetising current adds along it, V/A.
    decay: f32,
    /// What it takes away across it, V/A per electrical turn per period of the rotor.
    emf: f32,
    /// Voltage that may stay unexplained at standstill, V.
    allowed: f32,
}

/// The rotor flux in a sample, as the comparison takes it. Frequencies in electrical turns per period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorFlux {
    /// Magnetising current, A.
    pub magnetising: f32,
    /// Speed of the rotor.
    pub rotor_freq: f32,
    /// Axis of the flux when the sampled current flowed.
    pub axis: UnitVector,
    /// Frequency of the flux.
    pub flux_freq: f32,
}

/// State of the comparison.
#[derive(Clone, Copy, Debug, Default)]
pub struct PredictionState {
    /// Sum of the currents since it was judged last, A, and the last one before.
    currents: AlphaBeta,
    last: AlphaBeta,
    /// Sum of the computed voltages since they were last taken, and what was taken, V.
    voltages: AlphaBeta,
    taken: AlphaBeta,
    /// Voltage of the rotor that is expected in the mean of the samples between, V.
    rotor: AlphaBeta,
    unexplained: AlphaBeta,
}

/// Samples from one comparison to the next: half a carrier period. Over a whole one the carrier would be zero
/// in the mean, but a sensor that lies would drive the current for twice as long.
const JUDGED_EVERY: usize = CARRIER_SAMPLES / 2;

/// Share of the newest value in the filtered unexplained voltage: 2.6 ms.
const SMOOTHING: f32 = 0.276;
/// Share of the expected back-emf that may be wrong as well. All of it: 15° of angle error at 2 A
/// make the flux 1.7 times what the drive believes.
const EMF_SHARE: f32 = 1.0;

impl Prediction {
    /// For a motor, its current response, A/V, and an allowed voltage, V.
    pub fn new(motor: &Motor, plant: FirstOrder, allowed_v: f32) -> Self {
        let coupled = motor.coupled_inductance();
        Self {
            per_ampere: (1.0 / plant.k) as f32,
            pole: plant.p as f32,
            decay: coupled / motor.tau_r(),
            emf: coupled * TAU / PERIOD_S,
            allowed: allowed_v,
        }
    }

    /// The sample before it is judged: the voltage that the rotor flux adds to the applied one, V,
    /// (L_m/L_r)(1/tau_r - j w_r) psi.
    pub fn expect(&self, state: &mut PredictionState, flux: &RotorFlux) {
        let rotor = Dq {
            d: self.decay * flux.magnetising,
            q: -self.emf * flux.magnetising * flux.rotor_freq,
        };
        // The middle of the samples lies so far back from here.
        const MIDDLE: f32 = 0.5 * JUDGED_EVERY as f32 - 1.0;
        state.rotor = rotor.to_alpha_beta(flux.axis.turned_slightly(-MIDDLE * flux.flux_freq));
    }

    /// Every fifth sample: the current, A, which is [collected](PredictionState::collect)
    /// already.
    ///
    /// The mean of the model of a period, `i[k] - p i[k-1] = k_g v[k-2]`, over the five.
    ///
    /// # Errors
    /// The current is not as predicted.
    pub fn judge(&self, state: &mut PredictionState, current: AlphaBeta) -> Result<(), Fault> {
        const MEAN: f32 = 1.0 / JUDGED_EVERY as f32;
        let changed = (current - state.last) * self.pole + state.currents * (1.0 - self.pole);
        let unexplained = (changed * self.per_ampere - state.taken) * MEAN - state.rotor;
        state.unexplained += (unexplained - state.unexplained) * SMOOTHING;
        (state.last, state.currents) = (current, AlphaBeta::ZERO);
        // The two uncertainties are independent: their squares add.
        let allowed =
            self.allowed * self.allowed + EMF_SHARE * EMF_SHARE * state.rotor.length_squared();
        // (Not-a-number is not within the limit.)
        let explained = state.unexplained.length_squared() <= allowed;
        if explained { Ok(()) } else { Err(Fault::CurrentNotAsPredicted) }
    }
}

impl PredictionState {
    /// One sample: the current, A, and the voltage just computed, V.
    pub fn collect(&mut self, current: AlphaBeta, computed: AlphaBeta) {
        self.currents += current;
        self.voltages += computed;
    }

    /// Two samples before it is judged: what is computed in a sample acts between the next one and the one
    /// after that, and so explains the current two samples later.
    pub fn latch_voltage(&mut self) {
        self.taken = core::mem::replace(&mut self.voltages, AlphaBeta::ZERO);
    }
}
