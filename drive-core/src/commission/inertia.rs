//! Step 8: the inertia, with a free shaft, from what a torque does to the speed.
//!
//! The drive regulates torque: i_q = +i, -i, -i, +i for 0.8 s each. The speed rises, returns, falls, and returns. With x the
//! integral of i_q and f that of the direction of the speed w,
//!
//! ```text
//! w = K_t/J x - T_f/J f + c        K_t = 3/2 P (L_m^2/L_r) i_d
//! ```
//!
//! The inertia J and the friction T_f follow from the slopes of least squares. The tracked speed rings after a change of the
//! current, and is right while the acceleration is constant: only the second half of every quarter counts.

use super::collector::{Collector, Record};
use super::motion::Slope;
use super::report::{Meaning, Quantity, Refusal, Report, Step};
use super::{Commissioning, Next};
use crate::drive::{Excited, State};
use crate::io::periods;

/// Duration of a quarter, s, and the quarters of the measurement: three times + - - +.
const QUARTER_S: f32 = 0.8;
const QUARTERS: u8 = 12;
/// First current and least one, as shares of the rated peak: 0.15 and 0.1 A of 3.62 A.
const FIRST: f32 = 0.0414;
const LEAST: f32 = 0.0276;
/// Largest current, as a share of the limit.
const MOST: f32 = 0.8;
/// Peak of the speed that is aimed at, electrical rad/s: 60 rpm of four poles.
const PEAK_RAD_PER_S: f32 = 12.566;
/// Least share of the variance of the speed that inertia and friction explain.
const EXPLAINED: f32 = 0.9;

/// Progress of the step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Swings {
    /// Torque current, A.
    amperes: f32,
    /// Quarters that have ended.
    quarters: u8,
    /// Whether the current is that of the measurement.
    measures: bool,
}

impl Commissioning {
    pub(super) fn inertia(
        &mut self,
        drive: &Excited,
        sums: &mut Collector,
    ) -> Result<Next, Refusal> {
        let (rated, limit) = (self.setup.rated, self.setup.i_q_limit);
        match self.part {
            0 => {
                self.part = 1;
                self.found.inertia = None;
                return Ok(Next::Start);
            }
            1 if drive.state != State::Torque => return Ok(Next::Wait),
            1 => {
                self.part = 2;
                self.swings = Swings { amperes: FIRST * rated, ..Swings::default() };
                sums.begin(Record::Motion);
            }
            _ => self.swings.quarters += 1,
        }
        let Swings { amperes, quarters, measures } = self.swings;
        // + - - +, one after the other.
        let last = if measures { QUARTERS } else { 4 };
        if quarters < last {
            self.until = periods(QUARTER_S) * (u32::from(quarters) + 1);
            let ahead = matches!(quarters % 4, 0 | 3);
            return Ok(Next::Torque(if ahead { amperes } else { -amperes }));
        }
        let slope = sums.motion().slope();
        let follows = slope.explained >= EXPLAINED && slope.value > 0.0;
        if measures {
            return self.report_inertia(slope);
        }
        // Twice where it is too little to overcome the friction or to be seen; else as much as friction and the peak of the
        // speed ask for.
        let most = MOST * limit;
        let needed = (PEAK_RAD_PER_S / QUARTER_S + slope.friction.abs()) / slope.value;
        let next = if follows { needed } else { 2.0 * amperes };
        let wanted = next.clamp(LEAST * rated, most);
        let measures = follows || wanted >= most;
        self.swings = Swings { amperes: wanted, quarters: 0, measures };
        sums.begin(Record::Motion);
        self.until = periods(QUARTER_S);
        Ok(Next::Torque(wanted))
    }

    fn report_inertia(&mut self, slope: Slope) -> Result<Next, Refusal> {
        let explained = Quantity::new("explained share of the speed", "", slope.explained)
            .of((EXPLAINED, 1.0))
            .check(Meaning::NotFree, Meaning::NotFree)?;
        // Mechanical: the slopes are electrical.
        let inertia = self.setup.torque_per_ampere * self.setup.pole_pairs / slope.value;
        let friction = inertia * slope.friction / self.setup.pole_pairs;
        let values = [
            Quantity::new("inertia", "kg m2", inertia)
                .of((0.0, f32::INFINITY))
                .check(Meaning::NotFree, Meaning::NotFree)?,
            Quantity::new("friction", "Nm", friction),
            Quantity::new("torque current", "A", self.swings.amperes),
            explained,
        ];
        self.found.inertia = Some(inertia);
        Ok(Next::Report(Report::new(Step::Inertia, values)))
    }
}
