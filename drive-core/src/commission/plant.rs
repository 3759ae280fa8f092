//! The plants of the current loop from a pseudo-random voltage, as in section 3.7 of the dissertation; on request, with the
//! shaft locked, since a voltage across the flux turns a free one.
//!
//! Voltage and current pass the filter of the current loop, so the same equation holds between them, and the plant is that of
//! the motor. The analog filter of the currents has a delay of a part of a sample, which takes a second coefficient of the voltage:
//!
//! ```text
//! y[k] = p y[k-1] + b1 u[k-2] + b2 u[k-3] + c          plant k/(z - p), k = b1 + b2
//! ```
//!
//! with `c` for the bias and the voltage of the inverter. The unknowns come from the least squares of
//! [`rls`](crate::identify::rls::ud). On motors of half to twice the parameters of Table 5, k is within 6 % of that by the parameters;
//! 1 - p is weak.

use super::collector::{Collector, Record};
use super::plant_fit::SETTLING;
use super::plate::Plate;
use super::report::{Meaning, Quantity, Refusal, Report, Step};
use super::{Commissioning, Next, Progress};
use crate::drive::Excitation;
use crate::io::{PERIOD_S, periods};
use crate::math::frames::AlphaBeta;
use crate::settings::Motor;
use crate::tuning::{FirstOrder, motor_plant};

/// Bias along phase a, and current that a sample of the voltage makes, as shares of the test current: 97 mA of 3.6 A, which
/// takes 30 V with Table 5.
const BIAS: f32 = 0.5;
const STEP: f32 = 0.027;
/// Time until the flux stands, in rotor time constants, and between the axes, s.
const FLUX_T: f32 = 4.0;
const BETWEEN_S: f32 = 0.2;
/// Samples of the fit: six times the sequence.
const FITTED: u32 = 6 * 255;
/// Accepted k relative to that by the parameters, and accepted p.
const GAIN: (f32, f32) = (0.8, 1.25);
const POLE: (f32, f32) = (0.7, 0.9999);
impl Commissioning {
    pub(super) fn plant(&mut self, plate: &Plate, sums: &mut Collector) -> Result<Next, Refusal> {
        let motor = self.found.motor(&Motor::default()).ok_or(Refusal::Needs(Step::Leakage))?;
        let leakage = self.found.leakage.ok_or(Refusal::Needs(Step::Leakage))?.inductance;
        let amperes = STEP * plate.amperes;
        let volts = amperes * leakage / PERIOD_S;
        if let Some(designs) = self.design {
            let designs = designs.map_err(Refusal::Design)?;
            let circuit = motor_plant(&motor.circuit(), f64::from(PERIOD_S));
            let expected = circuit.map_err(Refusal::Design)?;
            let k = expected.k as f32;
            let gain = |name, plant: &FirstOrder| {
                Quantity::new(name, "A/V", plant.k as f32)
                    .of((GAIN.0 * k, GAIN.1 * k))
                    .check(Meaning::Loop, Meaning::Loop)
            };
            let pole = |name, plant: &FirstOrder| {
                Quantity::new(name, "", plant.p as f32).of(POLE).check(Meaning::Loop, Meaning::Loop)
            };
            let margin = |name, design: usize| {
                Quantity::new(name, "deg", designs[design].margins.phase_margin_deg as f32)
            };
            let [d, q] = &self.plants;
            let values = [
                Quantity::new("k by the parameters", "A/V", k),
                Quantity::new("p by the parameters", "", expected.p as f32),
                gain("k along", d)?,
                pole("p along", d)?,
                margin("phase margin by rule 3.8 along", 0),
                gain("k across", q)?,
                pole("p across", q)?,
                margin("phase margin by rule 3.8 across", 1),
            ];
            self.found.plants = Some(self.plants);
            return Ok(Next::Report(Report::new(Step::Plant, values)));
        }
        let bias = self.current(plate, BIAS, AlphaBeta::ZERO)?;
        let with = |wanted: AlphaBeta| match bias {
            Excitation::Current { amperes, regulator, .. } => {
                Excitation::Current { amperes, regulator, carrier: wanted, binary: true }
            }
            other => other,
        };
        let record = |across| Record::Plant { across, bases: (volts, amperes) };
        let length = SETTLING + FITTED;
        let in_volts = |plant: FirstOrder| FirstOrder {
            k: plant.k * f64::from(amperes) / f64::from(volts),
            ..plant
        };
        match self.part {
            0 => {
                self.found.plants = None;
                Ok(self.part(sums, Record::Nothing, periods(FLUX_T * motor.tau_r()), bias))
            }
            1 => Ok(self.part(sums, record(false), length, with(AlphaBeta::new(volts, 0.0)))),
            2 => {
                self.plants[0] = in_volts(sums.plant().ok_or(Refusal::SamplesLost)?);
                Ok(self.part(sums, Record::Nothing, periods(BETWEEN_S), bias))
            }
            3 => Ok(self.part(sums, record(true), length, with(AlphaBeta::new(0.0, volts)))),
            _ => {
                self.plants[1] = in_volts(sums.plant().ok_or(Refusal::SamplesLost)?);
                (self.part, self.until, self.progress) = (0, 0, Progress::StopToDesign);
                Ok(Next::Wait)
            }
        }
    }
}
