//! Step 4, the dc resistance test: two current levels along phase a with the [fit](super::fit) of the motor's parameters, and a
//! third level that confirms them.

use super::fit::bent;
use super::{
    Answer, BINS, Collector, Commissioning, Fitted, Levels, Meaning, Next, QUIET_S, Quantity,
    Record, Refusal, SIZE, Step, TIME,
};
use drive_core::{PERIOD_S, SQRT_3, TestSignal};

/// Current levels, as shares of the test current, and time of the first two, s. The last level is for an inverter whose
/// voltage error depends on the current.
const LEVELS: [f32; 4] = [0.8, 0.2, 0.45, 0.3];
const LEVEL_S: f32 = 1.5;
/// Largest relative deviation of the rotor resistance of a linear motor.
const LINEAR: f32 = 0.017;
/// Fastest shaft that counts as at rest, electrical rad/s. A free shaft turns by a few degrees.
const AT_REST: f32 = 1.0;
/// Largest difference of the switching delays of two legs, s.
const LEGS_S: f32 = 0.3e-6;
/// Largest misfit per noise of the current, V/A, per transient inductance, ohm/H; and as a share of the dc link.
const MISFIT_PER_NOISE: f32 = 105.0;
const MISFIT_OF_BUS: f32 = 8e-5;
/// A misfit up to this multiple of the largest one means that the main flux saturates.
const SATURATED: f32 = 30.0;
/// First bin of the end of a level, which gives the resistance if the main flux saturates.
const ENDS: usize = BINS - 2;
/// Largest voltage error of the third level: share of the resistive voltage, and of the dc link.
const THIRD: (f32, f32) = (0.01, 6.5e-5);
/// Share of that error from which on a fourth level has to confirm that the inverter voltage error depends on the current.
const BENT: f32 = 0.3;
/// Least voltage error of the inverter, as a share of the voltage of the dead time. If it is less, a large capacitance of the
/// output nodes makes it grow with the current up to the test current, like a resistance. (Transistors may turn off later than
/// they turn on.)
const DEAD_TIME: f32 = 0.7;
/// Wait before the third level is measured, and least time of its mean, in rotor time constants. Both together last at least as
/// long as each of the first two levels.
const WAIT_T: f32 = 3.0;
const MEAN_T: f32 = 1.0;

impl Commissioning {
    pub(super) fn levels(&mut self, sums: &mut Collector) -> Answer {
        let regulator = self.regulator()?;
        let noise = self.found.noise.ok_or(Refusal::Needs(Step::Sensors))?;
        let limit = MISFIT_OF_BUS * self.plate.dc_link;
        let limit = limit.max(MISFIT_PER_NOISE * self.rough()? * noise);
        let part = self.state.part;
        match part {
            0 => self.found.levels = None,
            // The first two levels have ended. (5 and 7: the third, the fourth.)
            3 => {
                let Some(fit) = self.search(sums, 0.0)? else { return Ok(Next::Wait) };
                let difference = self.across(sums, &fit, limit)?;
                // The low level has gone on as long as the search has taken.
                let low = LEVELS[1] * self.plate.amperes;
                let since = sums.recorded.samples as f32 * PERIOD_S / fit.tau_r;
                let magnetising = low + (fit.magnetising - low) * libm::expf(-since);
                self.state.fitted = Fitted { magnetising, difference, ..fit };
                if fit.misfit > limit || fit.deviations[2] > LINEAR * fit.r_r {
                    return self.report_saturated(sums, limit);
                }
                self.level_values(limit)?;
            }
            5 | 7 if self.is_confirmed(sums)? => {
                let values = self.level_values(limit)?;
                self.found.levels = Some(Levels::new(&self.state.fitted));
                return self.report(&values);
            }
            _ => {}
        }
        let tau_r = self.state.fitted.tau_r;
        let (wait, mean) = (WAIT_T * tau_r, (MEAN_T * tau_r).max(LEVEL_S - WAIT_T * tau_r));
        let [high, low, third, fourth] = LEVELS.map(|share| self.along(share, regulator));
        let parts = [
            (Record::Nothing, QUIET_S, TestSignal::Rest),
            (Record::bins(0, LEVEL_S), LEVEL_S, high),
            (Record::bins(1, LEVEL_S), LEVEL_S, low),
            (Record::Nothing, wait, third),
            (Record::bins(0, mean), mean, third),
            (Record::Nothing, wait, fourth),
            (Record::bins(0, mean), mean, fourth),
        ];
        self.begin(sums, parts[part % parts.len()])
    }

    /// Returns the relative difference of the currents of phases b and c. A rotating shaft makes a current across phase a that changes,
    /// and inverter legs that differ make a constant one.
    fn across(&self, sums: &Collector, fit: &Fitted, limit: f32) -> Result<f32, Refusal> {
        let [difference, volts, speed, misfit] = fit.across(sums).ok_or(Refusal::SamplesLost)?;
        let legs = LEGS_S / PERIOD_S * self.plate.dc_link * (1.0 / SQRT_3);
        let (moved, positive) = (2.0 * limit, (0.0, f32::INFINITY));
        Quantity::new("R_R", "ohm", fit.r_r).checked(positive, [Meaning::Turning; 2])?;
        Quantity::new("turning flux", "rad/s", speed).up_to(AT_REST, Meaning::Turning)?;
        Quantity::new("misfit across phase a", "V", misfit).up_to(moved, Meaning::Turning)?;
        Quantity::new("voltage across phase a", "V", volts).up_to(legs, Meaning::Legs)?;
        Ok(difference)
    }

    /// Whether the third level or the fourth confirms the result of the first two. The third level also shows by how much the
    /// inverter voltage error is smaller at a small current; if the difference is large, the fourth level has to confirm it.
    fn is_confirmed(&mut self, sums: &Collector) -> Result<bool, Refusal> {
        let (fit, seen) = (self.state.fitted, sums.mean(0, 0));
        let resistive = fit.r_s * seen.current.alpha;
        let allowed = THIRD.0 * resistive + THIRD.1 * self.plate.dc_link;
        // The rest of the transient from the level before is taken off.
        let (i, turned) = (seen.current.alpha, seen.periods * PERIOD_S / fit.tau_r);
        let behind = (i - fit.magnetising) * libm::expf(-WAIT_T);
        let rest = behind * -libm::expm1f(-turned) / turned;
        self.state.fitted.magnetising = i - behind * libm::expf(-turned);
        let is_third = self.state.part == 5;
        let error = seen.voltage - (fit.e - fit.bend / i) - resistive - fit.r_r * rest;
        // A capacitance is not negative, so the voltage error can only be smaller at the small current.
        if is_third && error > 0.0 {
            let third = (i, seen.voltage - fit.r_r * rest);
            let [high, low, ..] = LEVELS.map(|share| share * self.plate.amperes);
            let [high, low] = [high, low].map(|i| (i, fit.r_s * i + fit.e));
            let fitted = &mut self.state.fitted;
            [fitted.r_s, fitted.e, fitted.bend] = bent(&[high, low, third])?;
            if error > BENT * allowed {
                return Ok(false);
            }
        }
        Quantity::new("error of the last level", "V", error).up_to(allowed, Meaning::Inverter)?;
        Ok(true)
    }

    /// Reports that the main flux saturates: the ends of the levels give the resistance, and the magnetising-curve test is to give
    /// the rest.
    fn report_saturated(&mut self, sums: &Collector, limit: f32) -> Answer {
        let fit = self.state.fitted;
        Quantity::new("misfit", "V", fit.misfit)
            .checked((0.0, SATURATED * limit), [Meaning::Misfit; 2])?;
        let [high, low] = [0, 1].map(|half| sums.mean(half, ENDS));
        let r_s = (high.voltage - low.voltage) / (high.current.alpha - low.current.alpha);
        let ends = Fitted { r_s, e: low.voltage - r_s * low.current.alpha, ..fit };
        let levels = Levels { saturates: true, ..Levels::new(&ends) };
        let values = [
            Quantity::new("r_s", "ohm", levels.r_s).checked(self.plate.r_s, SIZE)?,
            self.inverter_voltage(&levels)?,
            Quantity::new("difference of b and c", "", levels.difference),
            misfit(&fit, limit),
        ];
        self.found.levels = Some(levels);
        self.report(&values)
    }

    fn inverter_voltage(&self, levels: &Levels) -> Result<Quantity, Refusal> {
        let of_dead_time = self.plate.dead_time * self.found.dc_link.unwrap_or(0.0);
        Quantity::new("inverter voltage", "V", levels.inverter_v)
            .checked((DEAD_TIME * of_dead_time, f32::INFINITY), [Meaning::Inverter; 2])
    }

    fn level_values(&self, limit: f32) -> Result<[Quantity; 7], Refusal> {
        let fit = &self.state.fitted;
        let (plate, levels) = (&self.plate, Levels::new(fit));
        let ([d_r_s, d_e, d_r_r, _], d_tau_r) = (fit.deviations, fit.tau_deviation);
        Ok([
            Quantity::new("r_s", "ohm", levels.r_s).within(d_r_s).checked(plate.r_s, SIZE)?,
            Quantity::new("R_R", "ohm", levels.r_r).within(d_r_r).checked(plate.r_r, SIZE)?,
            Quantity::new("tau_r", "s", levels.tau_r).within(d_tau_r).checked(plate.tau_r, TIME)?,
            Quantity::new("L_M", "H", levels.coupled()),
            self.inverter_voltage(&levels)?.within(0.75 * d_e),
            Quantity::new("difference of b and c", "", fit.difference),
            misfit(fit, limit),
        ])
    }
}

/// Returns the misfit, with the largest one of a linear motor as its limit.
fn misfit(fit: &Fitted, limit: f32) -> Quantity {
    Quantity::new("misfit", "V", fit.misfit).allowing((0.0, limit))
}
