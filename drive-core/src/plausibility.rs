//! Do the current sensors tell the truth? Two checks that need no third sensor.
//!
//! * The carrier must be seen by both channels, wherever the injection axis has a component along
//!   the axis of the channel: finds an open or stuck channel.
//! * The current must follow the applied voltage: the voltage that a first-order model of the motor
//!   cannot explain is filtered and must stay within what the back-emf can be.

use crate::angle::UnitVector;
use crate::fault::Fault;
use crate::frames::{AlphaBeta, SQRT_3};
use crate::injection::{CARRIER_COS, CARRIER_SAMPLES, CARRIER_SIN, CarrierPeriod};
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
    pub fn step(
        &mut self,
        measured: &Measured,
        carrier: CarrierPeriod,
        axis: UnitVector,
        expected: f32,
    ) -> Option<Fault> {
        let (c, s) = (
            CARRIER_COS[carrier.index % CARRIER_SAMPLES],
            CARRIER_SIN[carrier.index % CARRIER_SAMPLES],
        );
        for (sum, i) in self.sums.iter_mut().zip([measured.phases.a, measured.phases.b]) {
            sum.0 += c * i;
            sum.1 += s * i;
        }
        if carrier.index + 1 < CARRIER_SAMPLES {
            return None;
        }

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
    /// Voltage that may stay unexplained at standstill, V.
    allowed: f32,
    /// Further volts per electrical turn per period: one and a half times the back-emf.
    per_step: f32,
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

impl Prediction {
    /// For the current response of the motor, A/V, an allowed voltage, V, and the back-emf, V per
    /// electrical turn per period.
    pub fn new(plant: FirstOrder, allowed_v: f32, emf_per_step: f32) -> Self {
        Self {
            per_ampere: (1.0 / plant.k) as f32,
            pole: plant.p as f32,
            allowed: allowed_v,
            per_step: 1.5 * emf_per_step,
        }
    }

    /// One sample: the current, A; the voltage just computed, which acts in the next period, V; and
    /// the electrical speed, turns per period.
    pub fn step(
        &self,
        state: &mut PredictionState,
        current: AlphaBeta,
        computed: AlphaBeta,
        speed: f32,
    ) -> Option<Fault> {
        let needed = (current - state.last * self.pole) * self.per_ampere;
        state.unexplained += (needed - state.applied[1] - state.unexplained) * SMOOTHING;
        state.last = current;
        state.applied = [computed, state.applied[0]];
        let allowed = self.allowed + self.per_step * speed.abs();
        (state.unexplained.length_squared() > allowed * allowed)
            .then_some(Fault::CurrentNotAsPredicted)
    }
}
