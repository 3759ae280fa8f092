//! The plants of the current loop from a pseudo-random voltage, as in section 3.7 of the dissertation. The step is done on
//! request only and needs a locked shaft, since a voltage across the flux turns a free one.
//!
//! Voltage and current both pass the filter of the current loop, so the equation of the motor still holds between them. The analog
//! filter of the currents delays them by a part of a sample, for which the voltage has a second coefficient:
//!
//! ```text
//! y[k] = p y[k-1] + b1 u[k-2] + b2 u[k-3] + c          plant k/(z - p), k = b1 + b2
//! ```
//!
//! with `c` for the bias and the inverter voltage error. The unknowns come from the least squares of
//! [`rls`](rotor_id::rls::ud). On motors with half to twice the parameters of Table 5, k is within 6 % of the value that
//! follows from the parameters; 1 - p is uncertain.

use super::plant_fit::SETTLING;
use super::{Answer, Collector, Commissioning, Meaning, Next, Quantity, Record, Refusal, Step};
use drive_core::{AlphaBeta, FirstOrder, PERIOD_S, TestSignal};
use drive_settings::tuning::motor_plant;

/// Bias along phase a, and current that one sample of the voltage makes, as shares of the test current: 97 mA of 3.6 A,
/// which takes 30 V with Table 5.
const BIAS: f32 = 0.5;
const STEP: f32 = 0.027;
/// Time until the flux is established, in rotor time constants, and time between the two axes, s.
const FLUX_T: f32 = 4.0;
const BETWEEN_S: f32 = 0.2;
/// Time of a record, s: the settling and six times the sequence.
const FITTED_S: f32 = (SETTLING + 6 * 255) as f32 * PERIOD_S;
/// Accepted range of k relative to its value from the parameters, and accepted range of p.
const GAIN: (f32, f32) = (0.8, 1.25);
const POLE: (f32, f32) = (0.7, 0.9999);
impl Commissioning {
    pub(super) fn plant(&mut self, sums: &mut Collector) -> Answer {
        let motor = self.found.motor().ok_or(Refusal::Needs(Step::Leakage))?;
        let leakage = self.found.leakage.ok_or(Refusal::Needs(Step::Leakage))?.inductance;
        let i = STEP * self.plate.amperes;
        let volts = i * leakage / PERIOD_S;
        if self.state.design.is_none() {
            let regulator = self.regulator()?;
            match self.state.part {
                0 => self.found.plants = None,
                // A record has ended, along the bias or across it.
                part @ (2 | 4) => {
                    let found = sums.recorded.plant.found()?;
                    let k = found.k * f64::from(i) / f64::from(volts);
                    self.state.plants[usize::from(part == 4)] = Some(FirstOrder { k, ..found });
                }
                _ => {}
            }
            let (amperes, bias) = (BIAS * self.plate.amperes, self.along(BIAS, regulator));
            let axis = |across, carrier| {
                let excitation = TestSignal::Current { amperes, regulator, carrier, binary: true };
                (Record::Plant { across, bases: (volts, i) }, FITTED_S, excitation)
            };
            let parts = [
                (Record::Nothing, FLUX_T * motor.tau_r(), bias),
                axis(false, AlphaBeta::new(volts, 0.0)),
                (Record::Nothing, BETWEEN_S, bias),
                axis(true, AlphaBeta::new(0.0, volts)),
            ];
            if let Some(&part) = parts.get(self.state.part) {
                return self.begin(sums, part);
            }
        }
        let Some(designs) = self.designed()? else { return Ok(Next::Wait) };
        let circuit = motor_plant(&motor.into(), f64::from(PERIOD_S));
        let expected = circuit.map_err(Refusal::Design)?;
        let k = expected.k as f32;
        let (gain, meaning) = ((GAIN.0 * k, GAIN.1 * k), [Meaning::Loop; 2]);
        let [margin_d, margin_q] = designs.map(|design| design.margins.phase_margin_deg as f32);
        let [Some(d), Some(q)] = self.state.plants else { return Err(Refusal::SamplesLost) };
        let values = [
            Quantity::new("k by the parameters", "A/V", k),
            Quantity::new("p by the parameters", "", expected.p as f32),
            Quantity::new("k along", "A/V", d.k as f32).checked(gain, meaning)?,
            Quantity::new("p along", "", d.p as f32).checked(POLE, meaning)?,
            Quantity::new("phase margin by rule 3.8 along", "deg", margin_d),
            Quantity::new("k across", "A/V", q.k as f32).checked(gain, meaning)?,
            Quantity::new("p across", "", q.p as f32).checked(POLE, meaning)?,
            Quantity::new("phase margin by rule 3.8 across", "deg", margin_q),
        ];
        self.found.plants = Some([d, q]);
        self.report(&values)
    }
}
