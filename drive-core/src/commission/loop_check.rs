//! Step 7: the current loop, designed by the rule of section 3.8 and its limits for the motor that was found, and checked by
//! a step of the current along phase a.

use super::collector::{Collector, FIRST_BINS, Record};
use super::plate::Plate;
use super::report::{Meaning, Quantity, Refusal, Report, Step};
use super::{Commissioning, Next, Progress};
use crate::drive::{Excitation, Regulator};
use crate::io::{PERIOD_S, periods};
use crate::math::frames::AlphaBeta;
use crate::settings::Motor;
use crate::tuning::DIRECT_SHARE;

/// Currents before and after the step, as shares of the test current.
const STEP: [f32; 2] = [0.4, 0.7];
/// Current before the drive is stopped, likewise, and its time in rotor time constants.
const LOW: f32 = 0.1;
const LOW_T: f32 = 2.0;
/// Time before it, after the flux stands, and of the record, s.
const BEFORE_S: f32 = 0.2;
const RECORD_S: f32 = 0.25;
/// Bins at whose end the response counts as settled.
const SETTLED: usize = 45;
/// Largest overshoot of the design, relative to the step, and what noise adds in a mean of two samples.
const OVERSHOOT: f32 = 0.05;
const NOISES: f32 = 4.0;

impl Commissioning {
    pub(super) fn current_loop(
        &mut self,
        plate: &Plate,
        sums: &mut Collector,
    ) -> Result<Next, Refusal> {
        let motor = self.found.motor(&Motor::default()).ok_or(Refusal::Needs(Step::Leakage))?;
        let noise = self.found.noise.ok_or(Refusal::Needs(Step::Sensors))?;
        let Some(design) = self.design else {
            // Less flux first: while the next start has the low sides on, what is left drives a current against itself, which
            // turns a light shaft away.
            if self.part == 0 {
                self.found.plants = None;
                let low = self.current(plate, LOW, AlphaBeta::ZERO)?;
                return Ok(self.part(sums, Record::Nothing, periods(LOW_T * motor.tau_r()), low));
            }
            (self.part, self.until, self.progress) = (0, 0, Progress::StopToDesign);
            return Ok(Next::Wait);
        };
        let [design, _] = design.map_err(Refusal::Design)?;
        let regulator = Regulator {
            k_c: design.k_c as f32,
            z_c: design.z_c as f32,
            direct: DIRECT_SHARE,
            filtered: true,
        };
        let at = |share: f32| Excitation::Current {
            amperes: share * plate.amperes,
            regulator,
            carrier: AlphaBeta::ZERO,
            binary: false,
        };
        let record = Record::Bins { half: 0, first: RECORD_S / PERIOD_S / FIRST_BINS };
        match self.part {
            0 => {
                Ok(self.part(sums, Record::Nothing, periods(BEFORE_S + motor.tau_r()), at(STEP[0])))
            }
            1 => Ok(self.part(sums, record, periods(RECORD_S), at(STEP[1]))),
            _ => {
                let step = (STEP[1] - STEP[0]) * plate.amperes;
                let end = sums.mean(0, SETTLED).current.alpha;
                let highest = sums.bins(0).fold(f32::MIN, |most, bin| most.max(bin.current.alpha));
                let overshoot = (highest - end) / step;
                let missing = (end - STEP[1] * plate.amperes) / step;
                let allowed = OVERSHOOT + NOISES * noise / step;
                let values = [
                    Quantity::new("k_c", "V/A", regulator.k_c),
                    Quantity::new("z_c", "", regulator.z_c),
                    Quantity::new("phase margin", "deg", design.margins.phase_margin_deg as f32),
                    Quantity::new("crossover", "Hz", design.margins.crossover_hz as f32),
                    Quantity::new("overshoot", "", overshoot)
                        .of((-allowed, allowed))
                        .check(Meaning::Loop, Meaning::Loop)?,
                    Quantity::new("error after the step", "", missing)
                        .of((-allowed, allowed))
                        .check(Meaning::Loop, Meaning::Loop)?,
                ];
                Ok(Next::Report(Report::new(Step::CurrentLoop, values)))
            }
        }
    }
}
