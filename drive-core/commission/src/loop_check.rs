//! Step 7: the current loop. It is designed for the motor that was found, by the rule of section 3.8 and its limits, and
//! checked by a step of the current along phase a.

use super::{Answer, Collector, Commissioning, Meaning, Next, Quantity, Record, Refusal, Step};
use drive_core::Regulator;
use drive_core::current::DIRECT_SHARE;

/// Currents before and after the step, as shares of the test current.
const STEP: [f32; 2] = [0.4, 0.7];
/// Current before the drive is stopped, as a share of the test current, and its time in rotor time constants.
const LOW: f32 = 0.1;
const LOW_T: f32 = 2.0;
/// Time with an established flux before the step, and time of the record, s.
const BEFORE_S: f32 = 0.2;
const RECORD_S: f32 = 0.25;
/// Bin from which on the response counts as settled.
const SETTLED: usize = 45;
/// Largest overshoot of the design, relative to the step, and allowance for noise in a mean of two samples, in rms of the noise.
const OVERSHOOT: f32 = 0.05;
const NOISES: f32 = 4.0;

impl Commissioning {
    pub(super) fn current_loop(&mut self, sums: &mut Collector) -> Answer {
        let motor = self.found.motor().ok_or(Refusal::Needs(Step::Leakage))?;
        let noise = self.found.noise.ok_or(Refusal::Needs(Step::Sensors))?;
        if self.state.part == 0 {
            self.found.plants = None;
            // The flux is reduced first. The next start has the low sides on, and a flux that is left drives a current
            // against itself, which would turn a light shaft.
            let low = self.along(LOW, self.regulator()?);
            return self.begin(sums, (Record::Nothing, LOW_T * motor.tau_r(), low));
        }
        let Some([design, _]) = self.designed()? else { return Ok(Next::Wait) };
        let (k_c, z_c) = (design.k_c as f32, design.z_c as f32);
        let regulator = Regulator { k_c, z_c, direct: DIRECT_SHARE, filtered: true };
        let [before, after] = STEP.map(|share| self.along(share, regulator));
        let parts = [
            (Record::Nothing, BEFORE_S + motor.tau_r(), before),
            (Record::bins(0, RECORD_S), RECORD_S, after),
        ];
        if let Some(&part) = parts.get(self.state.part - 1) {
            return self.begin(sums, part);
        }
        let step = (STEP[1] - STEP[0]) * self.plate.amperes;
        let end = sums.mean(0, SETTLED).current.alpha;
        let highest = sums.bins(0).fold(f32::MIN, |most, bin| most.max(bin.current.alpha));
        let overshoot = (highest - end) / step;
        let missing = (end - STEP[1] * self.plate.amperes) / step;
        let allowed = OVERSHOOT + NOISES * noise / step;
        self.report(&[
            Quantity::new("k_c", "V/A", k_c),
            Quantity::new("z_c", "", z_c),
            Quantity::new("phase margin", "deg", design.margins.phase_margin_deg as f32),
            Quantity::new("crossover", "Hz", design.margins.crossover_hz as f32),
            Quantity::new("overshoot", "", overshoot).up_to(allowed, Meaning::Loop)?,
            Quantity::new("error after the step", "", missing).up_to(allowed, Meaning::Loop)?,
        ])
    }
}
