//! Step 8: the inertia, from the speed that a torque gives to a free shaft.
//!
//! The drive regulates torque: i_q = +i, -i, -i, +i for 0.8 s each. The speed rises, returns, falls, and returns. Let x be
//! the integral of i_q and f the integral of the sign of the speed w; then
//!
//! ```text
//! w = K_t/J x - T_f/J f + c        K_t = 3/2 P (L_m^2/L_r) i_d
//! ```
//!
//! The inertia J and the friction T_f follow from the slopes, by least squares. The tracked speed rings after a change of
//! the current and is right while the acceleration is constant, so only the second half of every quarter counts.

use super::motion::Slope;
use super::{Answer, Collector, Commissioning, Meaning, Next, Quantity, Record};
use drive_core::{State, TestReport, periods};

/// Duration of a quarter, s, and number of the quarters of the measurement: three times + - - +.
const QUARTER_S: f32 = 0.8;
const QUARTERS: usize = 12;
/// First current and smallest accepted current, as shares of the rated peak current: 0.15 A and 0.1 A of 3.62 A.
const FIRST: f32 = 0.0414;
const LEAST: f32 = 0.0276;
/// Largest current, as a share of the current limit.
const MOST: f32 = 0.8;
/// Peak of the speed that is aimed at, electrical rad/s: 60 rpm of four poles.
const PEAK_RAD_PER_S: f32 = 12.566;
/// Least share of the variance of the speed that inertia and friction explain.
const EXPLAINED: f32 = 0.9;
impl Commissioning {
    /// Part 0 starts the drive; every further part is a quarter.
    pub(super) fn inertia(&mut self, drive: &TestReport, sums: &mut Collector) -> Answer {
        let (rated, limit) = (self.plate.rated, self.plate.i_q_limit);
        match self.state.part {
            0 => {
                self.state.part = 1;
                self.found.inertia = None;
                return Ok(Next::Start);
            }
            1 if drive.state != State::Torque => return Ok(Next::Wait),
            1 => {
                self.state.amperes = FIRST * rated;
                sums.begin(Record::Motion);
            }
            _ => {}
        }
        let last = if self.state.measures { QUARTERS } else { 4 };
        if self.state.part > last {
            let slope = sums.recorded.motion.slope();
            if self.state.measures {
                return self.report_inertia(slope);
            }
            // The current is doubled if it is too small to overcome the friction or to move the shaft visibly. Otherwise
            // it is as large as the friction and the wanted peak of the speed require.
            let follows = slope.explained >= EXPLAINED && slope.value > 0.0;
            let most = MOST * limit;
            let needed = (PEAK_RAD_PER_S / QUARTER_S + slope.friction.abs()) / slope.value;
            let next = if follows { needed } else { 2.0 * self.state.amperes };
            self.state.amperes = next.clamp(LEAST * rated, most);
            self.state.measures = follows || self.state.amperes >= most;
            self.state.part = 1;
            sums.begin(Record::Motion);
        }
        // The quarters follow each other as + - - +.
        let ahead = matches!(self.state.part % 4, 0 | 1);
        self.state.until = periods(QUARTER_S) * self.state.part as u32;
        self.state.part += 1;
        let amperes = self.state.amperes;
        Ok(Next::Torque(if ahead { amperes } else { -amperes }))
    }

    fn report_inertia(&mut self, slope: Slope) -> Answer {
        let (explained, free) = (slope.explained, [Meaning::NotFree; 2]);
        let explained = Quantity::new("explained share of the speed", "", explained)
            .checked((EXPLAINED, 1.0), free)?;
        // The inertia is mechanical, the slopes are electrical.
        let inertia = self.plate.torque_per_ampere * self.plate.pole_pairs_in_force / slope.value;
        let friction = inertia * slope.friction / self.plate.pole_pairs_in_force;
        let values = [
            Quantity::new("inertia", "kg m2", inertia).checked((0.0, f32::INFINITY), free)?,
            Quantity::new("friction", "Nm", friction),
            Quantity::new("q-axis current", "A", self.state.amperes),
            explained,
        ];
        self.found.inertia = Some(inertia);
        self.report(&values)
    }
}
