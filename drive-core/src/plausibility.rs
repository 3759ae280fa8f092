//! Do the current sensors tell the truth? Two checks that need no third sensor.
//!
//! * The carrier must be seen by both channels, wherever the injection axis has a component along
//!   the axis of the channel: finds an open or stuck channel.
//! * The current must follow the applied voltage: the voltage that a first-order model of the motor
//!   and the back-emf of its rotor flux cannot explain is filtered and must stay small. That finds
//!   a sensor that lies, an open phase, and an angle or speed that is wrong while the rotor turns
//!   fast enough for its back-emf to stand out.

use core::f32::consts::TAU;

use crate::angle::UnitVector;
use crate::fault::Fault;
use crate::frames::{AlphaBeta, Dq, SQRT_3};
use crate::injection::{CARRIER_SAMPLES, CarrierPeriod};
use crate::sensing::Measured;
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
    /// Correlation of channels a and b with cosine and sine since the carrier period began.
    sums: [(f32, f32); 2],
    silent: [u8; 2],
    settled: u8,
}

impl CarrierWatch {
    /// One sample: phase currents in A, the carrier, the injection axis, and the amplitude of the
    /// carrier current expected along it, A.
    #[inline]
    pub fn step(
        &mut self,
        measured: &Measured,
        carrier: CarrierPeriod,
        axis: UnitVector,
        expected: f32,
    ) -> Option<Fault> {
        for (sum, i) in self.sums.iter_mut().zip([measured.phases.a, measured.phases.b]) {
            sum.0 += carrier.cos * i;
            sum.1 += carrier.sin * i;
        }
        if carrier.index + 1 < CARRIER_SAMPLES { None } else { self.judge(axis, expected) }
    }

    /// At the end of a carrier period.
    #[inline(never)]
    fn judge(&mut self, axis: UnitVector, expected: f32) -> Option<Fault> {
        // cos(theta) and cos(theta - 120°): what of the injection lies along phases a and b
        let along = [axis.cos, 0.5 * (SQRT_3 * axis.sin - axis.cos)];
        let sums = core::mem::take(&mut self.sums);
        // The first two carrier periods are not settled.
        if self.settled < 2 {
            self.settled += 1;
            return None;
        }
        for ((sum, along), silent) in sums.into_iter().zip(along).zip(&mut self.silent) {
            let amplitude_squared = (sum.0 * sum.0 + sum.1 * sum.1) * 0.04; // (2/10)^2
            let due = SILENT * expected * along;
            let judged = along.abs() > LEAST_SHARE;
            let quiet = judged && amplitude_squared < due * due;
            *silent = if quiet { silent.saturating_add(1) } else { 0 };
        }
        if self.silent[0] >= SILENT_PERIODS {
            Some(Fault::CarrierMissingA)
        } else if self.silent[1] >= SILENT_PERIODS {
            Some(Fault::CarrierMissingB)
        } else {
            None
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

/// What the comparison takes of the motor, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorFlux {
    /// (L_m / L_r) L_m, H.
    pub coupled_inductance: f32,
    /// Rotor time constant, s.
    pub t_sec: f32,
    /// Period of the control, s.
    pub period_s: f32,
}

/// State of the comparison.
#[derive(Clone, Copy, Debug, Default)]
pub struct PredictionState {
    last: AlphaBeta,
    /// Voltages of the present period and the one before, V.
    applied: [AlphaBeta; 2],
    unexplained: AlphaBeta,
}

/// Share of the newest value in the filtered unexplained voltage: 2.7 ms at 6 kHz, which takes the
/// carrier out.
const SMOOTHING: f32 = 1.0 / 16.0;
/// Share of the expected back-emf that may be wrong as well. All of it: 15° of angle error at 2 A
/// make the flux 1.7 times what the drive believes.
const EMF_SHARE: f32 = 1.0;

impl Prediction {
    /// For the current response of the motor, A/V, its rotor flux, and an allowed voltage, V.
    #[inline]
    pub fn new(plant: FirstOrder, flux: RotorFlux, allowed_v: f32) -> Self {
        Self {
            per_ampere: (1.0 / plant.k) as f32,
            pole: plant.p as f32,
            decay: flux.coupled_inductance / flux.t_sec,
            emf: flux.coupled_inductance * TAU / flux.period_s,
            allowed: allowed_v,
        }
    }

    /// The voltage that the rotor flux adds to the applied one, V in the flux frame,
    /// (L_m/L_r)(1/T_sec - j w_r) psi, with the magnetising current in A and the electrical speed of
    /// the rotor in turns per period.
    pub fn rotor_voltage(&self, magnetising: f32, rotor_step: f32) -> Dq {
        Dq { d: self.decay * magnetising, q: -self.emf * magnetising * rotor_step }
    }

    /// One sample: the current, A; the voltage just computed, which acts in the next period, V; and
    /// the expected voltage of the rotor, V.
    pub fn step(
        &self,
        state: &mut PredictionState,
        current: AlphaBeta,
        computed: AlphaBeta,
        rotor: AlphaBeta,
    ) -> Option<Fault> {
        let needed = (current - state.last * self.pole) * self.per_ampere;
        let unexplained = needed - state.applied[1] - rotor;
        state.unexplained += (unexplained - state.unexplained) * SMOOTHING;
        state.last = current;
        state.applied = [computed, state.applied[0]];
        // The two uncertainties are independent: their squares add.
        let allowed = self.allowed * self.allowed + EMF_SHARE * EMF_SHARE * rotor.length_squared();
        // Not-a-number is not within it.
        let explained = state.unexplained.length_squared() <= allowed;
        (!explained).then_some(Fault::CurrentNotAsPredicted)
    }
}
