//! The steps: their excitations in order, and what follows from the sums.

use super::collector::{Collector, Record};
use super::plate::Plate;
use super::report::{Meaning, Quantity, Refusal, Report, Step};
use super::{Commissioning, Next};
use crate::drive::{Excitation, Excited, Regulator};
use crate::io::{PERIOD_S, periods};
use crate::math::frames::AlphaBeta;
use crate::protect::wiring_check::{WiringCheck, WiringSettings};

/// Time of the sums without current, and of the pause before the pulses, s.
const QUIET_S: f32 = 0.1;
/// Largest offset and noise, as shares of the test current.
const OFFSET: f32 = 0.05;
const NOISE: f32 = 0.01;
/// Least dc link as a share of the peak of the rated voltage between lines.
const BUS: f32 = 0.37;

/// Current of an answered pulse, as a share of the test current, and the share at which the pulses are designed: no
/// answer reaches twice of it.
const ANSWERED: f32 = 0.08;
const EXPECTED: f32 = 0.125;
/// Current that a pulse may leave to the next one, likewise: resistances make it.
const RESIDUAL: f32 = 0.08;
/// Growth of the pulses.
const GROWTH: f32 = 1.6;
/// Pulses of a motor that is not there are answered by less than this share of the test current.
const SILENT: f32 = 0.02;
/// An answer counts as none below this share of the largest.
const UNANSWERED: f32 = 0.25;
/// The inductance by pulses may be that much smaller or larger than the true one.
const ROUGH: (f32, f32) = (0.5, 1.7);
/// Share of the rough inductance that the controller is designed for, its gain per inductance, and its zero, rad/s.
const CAUTION: f32 = 0.75;
const GAIN_RAD_PER_S: f32 = 500.0;
const ZERO_RAD_PER_S: f32 = 167.0;

impl Commissioning {
    /// The next part of the present step, once its samples are there.
    pub(super) fn go_on(&mut self, drive: &Excited, sums: &mut Collector) -> Result<Next, Refusal> {
        let plate = self.setup.plate?;
        match self.step {
            Step::Nameplate => Ok(Next::Report(plate.report())),
            Step::Sensors => self.sensors(&plate, drive, sums),
            Step::Wiring => self.wiring(&plate, drive, sums),
            Step::Levels => self.levels(&plate, sums),
            Step::Leakage => self.leakage(&plate, sums),
            Step::Staircase => self.staircase(&plate, sums),
            Step::CurrentLoop => self.current_loop(&plate, sums),
            Step::Plant => self.plant(&plate, sums),
            Step::Inertia => self.inertia(drive, sums),
        }
    }

    /// Begins a part that lasts for so many samples.
    pub(super) fn part(
        &mut self,
        sums: &mut Collector,
        record: Record,
        samples: u32,
        excitation: Excitation,
    ) -> Next {
        sums.begin(record);
        self.until = samples;
        self.part += 1;
        Next::Excite(excitation)
    }

    fn sensors(
        &mut self,
        plate: &Plate,
        drive: &Excited,
        sums: &mut Collector,
    ) -> Result<Next, Refusal> {
        if self.part == 0 {
            self.found.noise = None;
            return Ok(self.part(sums, Record::Noise, periods(QUIET_S), Excitation::Rest));
        }
        let (quiet, i) = (sums.quiet(), plate.amperes);
        let [noise_a, noise_b] = quiet.noise;
        let [offset_a, offset_b] = drive.offsets;
        let (offset, noise) = ((-OFFSET * i, OFFSET * i), (0.0, NOISE * i));
        let bus = (BUS * plate.peak_v, f32::INFINITY);
        let values = [
            Quantity::new("offset a", "A", offset_a)
                .of(offset)
                .check(Meaning::Offset, Meaning::Offset)?,
            Quantity::new("offset b", "A", offset_b)
                .of(offset)
                .check(Meaning::Offset, Meaning::Offset)?,
            Quantity::new("noise a", "A", noise_a)
                .of(noise)
                .check(Meaning::Noise, Meaning::Noise)?,
            Quantity::new("noise b", "A", noise_b)
                .of(noise)
                .check(Meaning::Noise, Meaning::Noise)?,
            Quantity::new("dc link", "V", quiet.dc_link)
                .of(bus)
                .check(Meaning::BusTooLow, Meaning::BusTooLow)?,
        ];
        self.found.noise = Some(noise_a.max(noise_b));
        self.found.dc_link = Some(quiet.dc_link);
        Ok(Next::Report(Report::new(Step::Sensors, values)))
    }

    /// The pulses with these volt-seconds.
    fn pulses(&self, plate: &Plate) -> WiringSettings {
        let expected_a = EXPECTED * plate.amperes;
        WiringSettings {
            sigma_ls: self.pulses.0 / expected_a,
            expected_a,
            noise_a: self.setup.pulse_noise + RESIDUAL * plate.amperes,
            highest_v: self.setup.pulse_v,
        }
    }

    fn wiring(
        &mut self,
        plate: &Plate,
        drive: &Excited,
        sums: &mut Collector,
    ) -> Result<Next, Refusal> {
        let i = plate.amperes;
        match self.part {
            0 => {
                self.found.rough = None;
                self.pulses = (SILENT * i * plate.leakage().0, 0);
                return Ok(self.part(sums, Record::Nothing, periods(QUIET_S), Excitation::Rest));
            }
            1 => {
                self.pulses.1 = drive.trains;
                self.part = 2;
                return Ok(Next::Excite(Excitation::Pulses(self.pulses(plate))));
            }
            _ if drive.trains == self.pulses.1 => return Ok(Next::Wait),
            _ => {}
        }
        let legs = drive.answers.map(|[a, b]| a.abs().max(b.abs()));
        let largest = legs.into_iter().fold(0.0, f32::max);
        // Not the volt-seconds, but the duration and the voltage are limited.
        let longest = self.setup.pulse_v * 60.0 * PERIOD_S;
        if largest < ANSWERED * i {
            if self.pulses.0 < longest {
                self.pulses.0 *= GROWTH;
                self.part = 1;
                return Ok(Next::Wait);
            }
            if largest < SILENT * i {
                return Err(Refusal::NoMotor);
            }
        }
        let open = |leg: &f32| *leg < UNANSWERED * largest;
        if let Some(leg) = legs.iter().position(open) {
            return Err(Refusal::PhaseOpen(leg as u8));
        }
        for sensor in 0..2 {
            if drive.answers.iter().all(|leg| leg[sensor].abs() < UNANSWERED * largest) {
                return Err(Refusal::SensorOpen(sensor as u8));
            }
        }
        let judged = WiringSettings { expected_a: largest, ..self.pulses(plate) };
        WiringCheck::new(&judged).judge(&drive.answers).map_err(Refusal::Wiring)?;
        let [[a, _], [_, b], [c_a, c_b]] = drive.answers;
        let put = self.pulses.0.min(longest);
        let (least, most) = plate.leakage();
        let rough = Quantity::new("sigma L_s, rough", "H", put * 3.0 / (a + b - c_a - c_b))
            .of((ROUGH.0 * least, ROUGH.1 * most))
            .check(Meaning::TooLarge, Meaning::TooSmall)?;
        self.found.rough = Some(rough.value);
        Ok(Next::Report(Report::new(Step::Wiring, [rough])))
    }

    /// Transient inductance by the pulses, rather too small, H.
    pub(super) fn rough(&self) -> Result<f32, Refusal> {
        Ok(CAUTION * self.found.rough.ok_or(Refusal::Needs(Step::Wiring))?)
    }

    /// A share of the test current along phase a, with a carrier.
    pub(super) fn current(
        &self,
        plate: &Plate,
        share: f32,
        carrier: AlphaBeta,
    ) -> Result<Excitation, Refusal> {
        let regulator = Regulator {
            k_c: GAIN_RAD_PER_S * self.rough()?,
            z_c: 1.0 - ZERO_RAD_PER_S * PERIOD_S,
            ..Regulator::default()
        };
        Ok(Excitation::Current {
            amperes: share * plate.amperes,
            regulator,
            carrier,
            binary: false,
        })
    }
}
