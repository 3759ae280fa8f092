//! The steps: their excitations in order, and what follows from the sums.

use core::ops::ControlFlow;

use super::collector::{BINS, Collector, FIRST_BINS, Record};
use super::found::{Leakage, Levels};
use super::leakage::{admittances, inductance, mismatch};
use super::levels::{Fitted, Search};
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

/// Current levels, as shares of the test current, and time of the first two, s.
const LEVELS: [f32; 3] = [0.8, 0.2, 0.45];
const LEVEL_S: f32 = 1.5;
/// Bins at the end of a level that count as steady.
const STEADY: usize = BINS - 6;
/// Largest deviation of the rotor resistance.
const UNCERTAIN: f32 = 0.03;
/// Largest gain mismatch.
const MISMATCH: f32 = 0.05;
/// Largest current across phase a, as a share of that along it, and of the test current.
const ACROSS: (f32, f32) = (0.015, 0.001);
/// Largest misfit per noise of the current, V/A, per transient inductance, ohm/H; and as a share of the dc link.
const MISFIT_PER_NOISE: f32 = 150.0;
const MISFIT_OF_BUS: f32 = 1e-4;
/// Largest error of the third level: share of the resistive voltage, and of the dc link.
const THIRD: (f32, f32) = (0.01, 6.5e-5);
/// Wait before the third level is measured, and time of its mean, in rotor time constants.
const WAIT_T: f32 = 3.0;
const MEAN_T: f32 = 0.5;

/// Bias of the carrier, as shares of the test current; carrier current likewise; largest carrier as a share of the dc link.
const BIASES: [f32; 2] = [0.5, 0.25];
const CARRIER: f32 = 0.07;
const CARRIER_OF_BUS: f32 = 0.3;
/// Control periods of a record, of the rise of the carrier, and of its fall.
const CARRIER_PERIODS: u32 = 1500;
const RISE_PERIODS: u32 = 300;
/// Largest gain mismatch that is left at the carrier.
const LEFT: f32 = 0.01;
/// rad/s.
const CARRIER_RAD_PER_S: f32 = core::f32::consts::TAU * 600.0;

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
            Step::Staircase => Ok(Next::Report(Report::new(Step::Staircase, []))),
            Step::CurrentLoop => self.current_loop(&plate, sums),
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

    /// A share of the test current along phase a, with a carrier.
    fn current(
        &self,
        plate: &Plate,
        share: f32,
        carrier: AlphaBeta,
    ) -> Result<Excitation, Refusal> {
        let rough = self.found.rough.ok_or(Refusal::Needs(Step::Wiring))?;
        let regulator = Regulator {
            k_c: GAIN_RAD_PER_S * CAUTION * rough,
            z_c: 1.0 - ZERO_RAD_PER_S * PERIOD_S,
            ..Regulator::default()
        };
        Ok(Excitation::Current { amperes: share * plate.amperes, regulator, carrier })
    }

    fn levels(&mut self, plate: &Plate, sums: &mut Collector) -> Result<Next, Refusal> {
        let at = |share| self.current(plate, share, AlphaBeta::ZERO);
        let [high, low, third] = [at(LEVELS[0])?, at(LEVELS[1])?, at(LEVELS[2])?];
        let noise = self.found.noise.ok_or(Refusal::Needs(Step::Sensors))?;
        let record =
            |half, seconds: f32| Record::Bins { half, first: seconds / PERIOD_S / FIRST_BINS };
        match self.part {
            0 => {
                self.found.levels = None;
                Ok(self.part(sums, Record::Nothing, periods(QUIET_S), Excitation::Rest))
            }
            1 => Ok(self.part(sums, record(0, LEVEL_S), periods(LEVEL_S), high)),
            2 => Ok(self.part(sums, record(1, LEVEL_S), periods(LEVEL_S), low)),
            3 => {
                sums.begin(Record::Nothing);
                self.search = Some(Search::new());
                (self.part, self.until) = (4, 0);
                Ok(Next::Wait)
            }
            4 => {
                let fit = match self.search.as_mut().map(|search| search.step(sums)) {
                    Some(ControlFlow::Continue(())) => return Ok(Next::Wait),
                    Some(ControlFlow::Break(Some(fit))) => fit,
                    _ => return Err(Refusal::SamplesLost),
                };
                self.search = None;
                let [ends, end] = [0, 1].map(|half| sums.mean(half, STEADY).current);
                let (da, db) = (ends.alpha - end.alpha, on_b(ends) - on_b(end));
                let mismatch = Quantity::new("gain mismatch", "", -da / (2.0 * db) - 1.0)
                    .of((-MISMATCH, MISMATCH))
                    .check(Meaning::Mismatch, Meaning::Mismatch)?
                    .value;
                self.check_rest(plate, sums, mismatch, noise)?;
                let report = self.report_levels(plate, &fit, mismatch, noise)?;
                self.fitted = (fit, mismatch, Some(report));
                let wait = WAIT_T * fit.tau_r;
                Ok(self.part(sums, Record::Nothing, periods(wait), third))
            }
            5 => {
                let mean = MEAN_T * self.fitted.0.tau_r;
                Ok(self.part(sums, record(0, mean.max(QUIET_S)), periods(mean.max(QUIET_S)), third))
            }
            _ => {
                let ((fit, mismatch, report), seen) = (self.fitted, sums.mean(0, 0));
                let report = report.ok_or(Refusal::SamplesLost)?;
                let resistive = fit.r_s * seen.current.alpha;
                let allowed = THIRD.0 * resistive + THIRD.1 * self.setup.dc_link;
                // What is left of the transient from the second level.
                let turned = seen.periods * PERIOD_S / fit.tau_r;
                let rest = libm::expf(-WAIT_T) * -libm::expm1f(-turned) / turned;
                let rotor = fit.r_r * (LEVELS[2] - LEVELS[1]) * plate.amperes * rest;
                let error = seen.voltage - fit.e - resistive - rotor;
                Quantity::new("error of the third level", "V", error)
                    .of((-allowed, allowed))
                    .check(Meaning::Inverter, Meaning::Inverter)?;
                self.found.levels = Some(Levels::new(&fit, mismatch));
                Ok(Next::Report(report))
            }
        }
    }

    /// No current may flow across phase a, once the gains are corrected.
    fn check_rest(
        &self,
        plate: &Plate,
        sums: &Collector,
        mismatch: f32,
        noise: f32,
    ) -> Result<(), Refusal> {
        for bin in sums.bins(0).chain(sums.bins(1)) {
            let (a, b) = (bin.current.alpha, on_b(bin.current));
            let (a, b) = (a / (1.0 + 0.5 * mismatch), b * (1.0 + 0.5 * mismatch));
            let across = (a + 2.0 * b) * (1.0 / SQRT_3);
            let allowed = ACROSS.0 * a.abs() + ACROSS.1 * plate.amperes;
            let allowed = allowed + 6.0 * noise / libm::sqrtf(bin.periods);
            Quantity::new("current across phase a", "A", across)
                .of((-allowed, allowed))
                .check(Meaning::Turning, Meaning::Turning)?;
        }
        Ok(())
    }

    fn report_levels(
        &self,
        plate: &Plate,
        fit: &Fitted,
        mismatch: f32,
        noise: f32,
    ) -> Result<Report, Refusal> {
        let rough = self.found.rough.ok_or(Refusal::Needs(Step::Wiring))?;
        let levels = Levels::new(fit, mismatch);
        let [d_r_s, d_e, d_r_r] = fit.deviations;
        let limit = MISFIT_OF_BUS * self.setup.dc_link;
        let limit = limit.max(MISFIT_PER_NOISE * CAUTION * rough * noise);
        let (large, small) = (Meaning::TooLarge, Meaning::TooSmall);
        let r_r = Quantity::new("R_R", "ohm", levels.r_r).within(d_r_r).of(plate.r_r());
        Quantity::new("misfit", "V", fit.misfit)
            .of((0.0, limit))
            .check(Meaning::Misfit, Meaning::Misfit)?;
        let values = [
            Quantity::new("r_s", "ohm", levels.r_s)
                .within(d_r_s)
                .of(plate.r_s())
                .check(large, small)?,
            r_r.check(large, small)?,
            Quantity::new("tau_r", "s", levels.tau_r)
                .within(fit.tau_deviation)
                .of(Plate::TAU_R)
                .check(small, large)?,
            Quantity::new("L_M", "H", levels.coupled()),
            Quantity::new("inverter voltage", "V", levels.inverter_v).within(0.75 * d_e),
            Quantity::new("gain mismatch", "", mismatch),
            Quantity::new("misfit", "V", fit.misfit),
        ];
        Quantity::new("deviation of R_R", "ohm", d_r_r)
            .of((0.0, UNCERTAIN * levels.r_r))
            .check(Meaning::Uncertain, Meaning::Uncertain)?;
        Ok(Report::new(Step::Levels, values))
    }

    fn leakage(&mut self, plate: &Plate, sums: &mut Collector) -> Result<Next, Refusal> {
        let levels = self.found.levels.ok_or(Refusal::Needs(Step::Levels))?;
        let rough = self.found.rough.ok_or(Refusal::Needs(Step::Wiring))?;
        let volts = CARRIER * plate.amperes * CARRIER_RAD_PER_S * CAUTION * rough;
        let volts = volts.min(CARRIER_OF_BUS * self.setup.dc_link);
        // Per bias: settle; along: rise, record; fall; across: rise, record; fall.
        let (bias, part) = (usize::from(self.part / 7), self.part % 7);
        let Some(&share) = BIASES.get(bias) else { return self.report_leakage(plate) };
        let none = AlphaBeta::ZERO;
        let (along, across) = (AlphaBeta::new(volts, 0.0), AlphaBeta::new(0.0, volts));
        let (record, samples, carrier) = match part {
            0 => (Record::Nothing, periods(3.0 * levels.tau_r), none),
            1 => (Record::Nothing, RISE_PERIODS, along),
            2 => (Record::Carrier, CARRIER_PERIODS, along),
            3 | 6 => {
                let seen = sums.phasors();
                let axis = usize::from(part == 6);
                let half = 0.5 * levels.mismatch;
                let gain = if axis == 0 { 1.0 + half } else { 1.0 - half };
                let (least, most) = plate.leakage();
                let henry = inductance(
                    admittances(&seen)[axis] / gain,
                    levels.r_s + levels.r_r,
                    self.setup.filter,
                    (0.1 * least, 10.0 * most),
                );
                self.inductances[bias][axis] = henry;
                if axis == 0 {
                    let noise = self.found.noise.ok_or(Refusal::Needs(Step::Sensors))?;
                    let amperes = volts * admittances(&seen)[0];
                    let allowed =
                        6.0 * noise / (amperes * libm::sqrtf(CARRIER_PERIODS as f32 / 2.0));
                    let allowed = allowed.max(LEFT);
                    Quantity::new("gain mismatch at 600 Hz", "", mismatch(&seen) - levels.mismatch)
                        .of((-allowed, allowed))
                        .check(Meaning::Turning, Meaning::Turning)?;
                }
                (Record::Nothing, RISE_PERIODS, none)
            }
            4 => (Record::Nothing, RISE_PERIODS, across),
            _ => (Record::Carrier, CARRIER_PERIODS, across),
        };
        let excitation = self.current(plate, share, carrier)?;
        Ok(self.part(sums, record, samples, excitation))
    }

    fn report_leakage(&mut self, plate: &Plate) -> Result<Next, Refusal> {
        let saliency = |[along, across]: [f32; 2]| (across - along) / (across + along);
        let [high, low] = self.inductances;
        let inductance = 0.25 * (high[0] + high[1] + low[0] + low[1]);
        let values = [
            Quantity::new("sigma L_s", "H", inductance)
                .of(plate.leakage())
                .check(Meaning::TooLarge, Meaning::TooSmall)?,
            Quantity::new("saliency at half the current", "", saliency(high)),
            Quantity::new("saliency at a quarter", "", saliency(low)),
        ];
        self.found.leakage = Some(Leakage { inductance, saliency: saliency(high) });
        Ok(Next::Report(Report::new(Step::Leakage, values)))
    }
}

const SQRT_3: f32 = 1.732_050_8;

/// Phase current b of a current vector, A.
fn on_b(i: AlphaBeta) -> f32 {
    0.5 * (SQRT_3 * i.beta - i.alpha)
}
