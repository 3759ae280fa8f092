//! Steps 2 and 3: the sensors at zero current, and the pulses of the wiring check.

use super::{Answer, Collector, Commissioning, Meaning, Next, Quantity, Record, Refusal, SIZE};
use drive_core::protect::{WiringCheck, WiringSettings};
use drive_core::{PERIOD_S, TestReport, TestSignal};

/// Time of the sums without current, and of the pause before the pulses and before the levels, s.
pub(super) const QUIET_S: f32 = 0.1;
/// Largest offset and noise, as shares of the test current.
const OFFSET: f32 = 0.05;
const NOISE: f32 = 0.01;
/// Least dc link as a share of the peak of the rated voltage between lines.
const BUS: f32 = 0.37;

/// Least current of a pulse that counts as a response, as a share of the test current, and the share for which the
/// pulses are designed. No response reaches twice that share.
const ANSWERED: f32 = 0.08;
const EXPECTED: f32 = 0.125;
/// Current that may be left from the pulse before, due to resistances, as a share of the test current.
const RESIDUAL: f32 = 0.08;
/// Factor by which the pulses grow.
const GROWTH: f32 = 1.6;
/// If the largest response is below this share of the test current, there is no motor.
const SILENT: f32 = 0.02;
/// A response counts as none below this share of the largest.
const UNANSWERED: f32 = 0.25;
/// Factors by which the inductance from the pulses may be smaller or larger than the true one.
const ROUGH: (f32, f32) = (0.5, 1.7);

impl Commissioning {
    pub(super) fn sensors(&mut self, drive: &TestReport, sums: &mut Collector) -> Answer {
        if self.state.part == 0 {
            self.found.noise = None;
            return self.begin(sums, (Record::Noise, QUIET_S, TestSignal::Rest));
        }
        let ([noise_a, noise_b], dc_link) = sums.quiet();
        let ([offset_a, offset_b], i) = (drive.offsets, self.plate.amperes);
        let (offset, noise) = (OFFSET * i, (0.0, NOISE * i));
        let bus = (BUS * self.plate.peak_v, f32::INFINITY);
        let values = [
            Quantity::new("offset a", "A", offset_a).up_to(offset, Meaning::Offset)?,
            Quantity::new("offset b", "A", offset_b).up_to(offset, Meaning::Offset)?,
            Quantity::new("noise a", "A", noise_a).checked(noise, [Meaning::Noise; 2])?,
            Quantity::new("noise b", "A", noise_b).checked(noise, [Meaning::Noise; 2])?,
            Quantity::new("dc link", "V", dc_link).checked(bus, [Meaning::BusTooLow; 2])?,
        ];
        self.found.noise = Some(noise_a.max(noise_b));
        self.found.dc_link = Some(dc_link);
        self.report(&values)
    }

    /// Returns the settings of the present pulses.
    fn pulses(&self) -> WiringSettings {
        let expected_a = EXPECTED * self.plate.amperes;
        let sigma_ls = self.state.volt_seconds / expected_a;
        let noise_a = self.plate.pulse_noise + RESIDUAL * self.plate.amperes;
        WiringSettings { sigma_ls, expected_a, noise_a, highest_v: self.plate.pulse_v }
    }

    pub(super) fn wiring(&mut self, drive: &TestReport, sums: &mut Collector) -> Answer {
        let (i, (least, most)) = (self.plate.amperes, self.plate.leakage);
        match self.state.part {
            0 => {
                self.found.rough = None;
                self.state.volt_seconds = SILENT * i * least;
                return self.begin(sums, (Record::Nothing, QUIET_S, TestSignal::Rest));
            }
            1 => {
                self.state.trains = drive.trains;
                self.state.part = 2;
                return Ok(Next::Excite(TestSignal::Pulses(self.pulses())));
            }
            _ if drive.trains == self.state.trains => return Ok(Next::Wait),
            _ => {}
        }
        let legs = drive.answers.map(|[a, b]| a.abs().max(b.abs()));
        let largest = legs.into_iter().fold(0.0, f32::max);
        // Duration and voltage of the pulses are limited, which limits the volt-seconds.
        let longest = self.plate.pulse_v * 60.0 * PERIOD_S;
        if largest < ANSWERED * i && self.state.volt_seconds < longest {
            self.state.volt_seconds *= GROWTH;
            self.state.part = 1;
            return Ok(Next::Wait);
        }
        if largest < SILENT * i {
            return Err(Refusal::NoMotor);
        }
        let is_open = |answer: f32| answer < UNANSWERED * largest;
        if let Some(leg) = legs.into_iter().position(is_open) {
            return Err(Refusal::PhaseOpen(leg as u8));
        }
        let is_silent =
            |sensor: &usize| drive.answers.iter().all(|leg| is_open(leg[*sensor].abs()));
        if let Some(sensor) = (0..2).find(is_silent) {
            return Err(Refusal::SensorOpen(sensor as u8));
        }
        let judged = WiringSettings { expected_a: largest, ..self.pulses() };
        WiringCheck::new(&judged).judge(&drive.answers).map_err(Refusal::Wiring)?;
        let [[a, _], [_, b], [c_a, c_b]] = drive.answers;
        let put = self.state.volt_seconds.min(longest);
        let rough = Quantity::new("sigma L_s, rough", "H", put * 3.0 / (a + b - c_a - c_b))
            .checked((ROUGH.0 * least, ROUGH.1 * most), SIZE)?;
        self.found.rough = Some(rough.value);
        self.report(&[rough])
    }
}
