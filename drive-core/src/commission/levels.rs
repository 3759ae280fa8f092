//! Step 4: two current levels along phase a and a third, and what the [fit](super::fit) finds in them.

use core::ops::ControlFlow;

use super::collector::{BINS, Collector, FIRST_BINS, Record};
use super::fit::{Fitted, Search};
use super::found::Levels;
use super::plate::Plate;
use super::report::{Meaning, Quantity, Refusal, Report, Step};
use super::{Commissioning, Next};
use crate::drive::Excitation;
use crate::io::{PERIOD_S, periods};
use crate::math::frames::{AlphaBeta, SQRT_3};

/// Pause before the first level, s.
const QUIET_S: f32 = 0.1;
/// Current levels, as shares of the test current, and time of the first two, s. The last is for an inverter whose voltage
/// depends on the current.
const LEVELS: [f32; 4] = [0.8, 0.2, 0.45, 0.3];
const LEVEL_S: f32 = 1.5;
/// Bins at the end of a level that count as steady.
const STEADY: usize = BINS - 6;
/// Largest deviation of the rotor resistance of a linear motor.
const LINEAR: f32 = 0.017;
/// Largest gain mismatch.
const MISMATCH: f32 = 0.05;
/// Largest current across phase a, as a share of that along it, and of the test current.
const ACROSS: (f32, f32) = (0.015, 0.001);
/// Largest misfit per noise of the current, V/A, per transient inductance, ohm/H; and as a share of the dc link.
const MISFIT_PER_NOISE: f32 = 105.0;
const MISFIT_OF_BUS: f32 = 8e-5;
/// A misfit up to this multiple of it is that of a main flux that saturates.
const SATURATED: f32 = 30.0;
/// Bins at the end of a level that give its resistance then.
const ENDS: usize = BINS - 2;
/// Largest error of the third level: share of the resistive voltage, and of the dc link.
const THIRD: (f32, f32) = (0.01, 6.5e-5);
/// Share of it from which on the inverter's voltage is taken to depend on the current.
const BENT: f32 = 0.3;
/// Least voltage of the inverter, as a share of that of the dead time: with less, nodes of much capacitance make it grow with the
/// current up to the test current, like a resistance. (Transistors may turn off later than they turn on.)
const DEAD_TIME: f32 = 0.7;
/// Wait before the third level is measured, and time of its mean, in rotor time constants.
const WAIT_T: f32 = 3.0;
const MEAN_T: f32 = 0.5;

impl Fitted {
    /// With an inverter whose voltage is e - d/i, as that of nodes whose capacitance the current has to swing. The line through
    /// the first two levels misses the third, of a test current `i`, by `error`.
    fn bent(self, error: f32, i: f32) -> Self {
        let [high, low, third, _] = LEVELS;
        let slope = -1.0 / (high * low);
        let missed = 1.0 / low + slope * (third - low) - 1.0 / third;
        let bend = error * i / missed;
        let r_s = self.r_s + slope * bend / (i * i);
        let e = self.e + (self.r_s - r_s) * high * i + bend / (high * i);
        Self { r_s, e, bend, ..self }
    }
}

impl Commissioning {
    pub(super) fn levels(&mut self, plate: &Plate, sums: &mut Collector) -> Result<Next, Refusal> {
        let at = |share| self.current(plate, share, AlphaBeta::ZERO);
        let [high, low, third, fourth] = LEVELS.map(at);
        let (high, low, third, fourth) = (high?, low?, third?, fourth?);
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
                let limit = MISFIT_OF_BUS * self.setup.dc_link;
                let limit = limit.max(MISFIT_PER_NOISE * self.rough()? * noise);
                let misfit = Quantity::new("misfit", "V", fit.misfit).of((0.0, limit));
                if fit.misfit > limit || fit.deviations[2] > LINEAR * fit.r_r {
                    let most = misfit.of((0.0, SATURATED * limit));
                    most.check(Meaning::Misfit, Meaning::Misfit)?;
                    return self.saturated(plate, sums, &fit, mismatch, misfit);
                }
                self.report_levels(plate, &fit, mismatch, misfit)?;
                self.fitted = (fit, mismatch, Some(misfit));
                let wait = WAIT_T * fit.tau_r;
                Ok(self.part(sums, Record::Nothing, periods(wait), third))
            }
            5 | 7 => {
                let at = if self.part == 5 { third } else { fourth };
                let mean = MEAN_T * self.fitted.0.tau_r;
                Ok(self.part(sums, record(0, mean.max(QUIET_S)), periods(mean.max(QUIET_S)), at))
            }
            _ => {
                let ((fit, mismatch, misfit), seen) = (self.fitted, sums.mean(0, 0));
                let misfit = misfit.ok_or(Refusal::SamplesLost)?;
                let resistive = fit.r_s * seen.current.alpha;
                let allowed = THIRD.0 * resistive + THIRD.1 * self.setup.dc_link;
                // What is left of the transient from the level before.
                let turned = seen.periods * PERIOD_S / fit.tau_r;
                let rest = libm::expf(-WAIT_T) * -libm::expm1f(-turned) / turned;
                let [_, before, now, last] = LEVELS.map(|share| share * plate.amperes);
                let is_third = self.part == 6;
                let stepped = if is_third { now - before } else { last - now };
                let bent = fit.e - fit.bend / seen.current.alpha;
                let error = seen.voltage - bent - resistive - fit.r_r * stepped * rest;
                if is_third && error > BENT * allowed {
                    self.fitted.0 = fit.bent(error, plate.amperes);
                    return Ok(self.part(
                        sums,
                        Record::Nothing,
                        periods(WAIT_T * fit.tau_r),
                        fourth,
                    ));
                }
                Quantity::new("error of the last level", "V", error)
                    .of((-allowed, allowed))
                    .check(Meaning::Inverter, Meaning::Inverter)?;
                let report = self.report_levels(plate, &fit, mismatch, misfit)?;
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
            let allowed = allowed + 6.0 * noise / fpu_sqrt::sqrtf(bin.periods);
            Quantity::new("current across phase a", "A", across)
                .of((-allowed, allowed))
                .check(Meaning::Turning, Meaning::Turning)?;
        }
        Ok(())
    }

    /// The main flux saturates: the ends of the levels give the resistance, the staircase is to give the rest.
    fn saturated(
        &mut self,
        plate: &Plate,
        sums: &Collector,
        fit: &Fitted,
        mismatch: f32,
        misfit: Quantity,
    ) -> Result<Next, Refusal> {
        let [high, low] = [0, 1].map(|half| sums.mean(half, ENDS));
        let r_s = (high.voltage - low.voltage) / (high.current.alpha - low.current.alpha);
        let ends = Fitted { r_s, e: low.voltage - r_s * low.current.alpha, ..*fit };
        let levels = Levels { saturates: true, ..Levels::new(&ends, mismatch) };
        let values = [
            Quantity::new("r_s", "ohm", levels.r_s)
                .of(plate.r_s())
                .check(Meaning::TooLarge, Meaning::TooSmall)?,
            self.inverter_voltage(&levels).check(Meaning::Inverter, Meaning::Inverter)?,
            Quantity::new("gain mismatch", "", mismatch),
            misfit,
        ];
        self.found.levels = Some(levels);
        Ok(Next::Report(Report::new(Step::Levels, values)))
    }

    fn inverter_voltage(&self, levels: &Levels) -> Quantity {
        let of_dead_time = self.setup.dead_time * self.found.dc_link.unwrap_or(0.0);
        Quantity::new("inverter voltage", "V", levels.inverter_v)
            .of((DEAD_TIME * of_dead_time, f32::INFINITY))
    }

    fn report_levels(
        &self,
        plate: &Plate,
        fit: &Fitted,
        mismatch: f32,
        misfit: Quantity,
    ) -> Result<Report, Refusal> {
        let levels = Levels::new(fit, mismatch);
        let [d_r_s, d_e, d_r_r] = fit.deviations;
        let (large, small) = (Meaning::TooLarge, Meaning::TooSmall);
        let r_r = Quantity::new("R_R", "ohm", levels.r_r).within(d_r_r).of(plate.r_r());
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
            self.inverter_voltage(&levels)
                .within(0.75 * d_e)
                .check(Meaning::Inverter, Meaning::Inverter)?,
            Quantity::new("gain mismatch", "", mismatch),
            misfit,
        ];
        Ok(Report::new(Step::Levels, values))
    }
}

/// Phase current b of a current vector, A.
fn on_b(i: AlphaBeta) -> f32 {
    0.5 * (SQRT_3 * i.beta - i.alpha)
}
