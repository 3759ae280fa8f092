//! The points of the self-commissioning, and their order.

use core::f32::consts::PI;

use super::{Learning, LearningState};

/// Settling time of the q-axis current and the averages at every point, s, and of slip and flux, in rotor time constants. If the
/// q-axis current changes, the saturation changes; if the current changes its sign, the flux turns in the frame. (With 0.2, motors
/// whose rotor time constant is above 0.45 s had an even part of the signal that spread by up to 0.007.)
const SETTLE_S: f32 = 0.1;
const SETTLE_T: f32 = 1.0;
/// Settling time at the first point, in rotor time constants.
const FIRST_T: f32 = 2.0;
/// Averaging time at a point of the sensitivity under load, s.
const SLOPE_S: f32 = 0.5;

/// A point of the self-commissioning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    /// Index of the current in the table.
    pub n: usize,
    /// Index of the lead in [`LEADS`].
    pub lead: usize,
    /// Whether the point is the second of its pair, with q-axis current and lead of the opposite sign.
    pub mirrored: bool,
    /// Settling time, s, and least averaging time, s.
    pub settle_s: f32,
    pub average_s: f32,
    /// Whether the point lasts for whole half turns of the flux.
    pub turns: bool,
}

impl Learning {
    /// Averaging time at a point of the offset, s. One second reduces sensor noise of 5 mA to 0.2°.
    pub const AVERAGE_S: f32 = 1.0;

    /// Returns the number of points: two for every current, two for every other current with either lead of the flux, and two
    /// for a lead without current.
    pub fn points(&self) -> usize {
        let led = if self.normalised { 2 * self.led() + 1 } else { 0 };
        2 * (self.points + led)
    }

    /// Returns the number of currents with a lead: the last, and every other one below it.
    fn led(&self) -> usize {
        self.points.div_ceil(2)
    }

    /// Returns the number of the point that is being measured, from 1, and the number of points.
    pub fn progress(&self, state: &LearningState) -> (usize, usize) {
        (self.points().min(state.point + 1), self.points())
    }

    /// Returns the expected time, s, from the beginning of a point, numbered from 1, to the end of the self-commissioning.
    pub fn seconds_left(&self, point: usize) -> f32 {
        let seconds = |number| {
            let Point { n, settle_s, average_s, turns, .. } = self.point(number);
            let half_turn_s = PI * self.tau_r * self.i_d / self.grid.current(n);
            let halves = if turns { libm::ceilf(average_s / half_turn_s) } else { 0.0 };
            settle_s + average_s.max(halves * half_turn_s)
        };
        (point.max(1) - 1..self.points()).map(seconds).sum()
    }

    /// Returns the point with this number. Pairs without lead come first, from the first current down, then from the largest
    /// current down. Then follow the pairs in which the flux is ahead, from zero current up, and the pairs in which it is
    /// behind, down again.
    #[cold]
    pub(super) fn point(&self, number: usize) -> Point {
        let (pair, mirrored) = (number / 2, !number.is_multiple_of(2));
        let (led, [step_t, turned_t]) = (self.led(), self.flux_t);
        let (n, lead, flux_t, average_s) = match pair.checked_sub(self.points) {
            None => {
                let n = if pair < self.first { self.first } else { self.points + self.first };
                (n - pair, 0, if pair == 0 { FIRST_T } else { 0.0 }, Self::AVERAGE_S)
            }
            Some(0) => (0, 1, SETTLE_T, Self::AVERAGE_S),
            Some(up) if up <= led => (self.points - 2 * (led - up), 1, step_t, SLOPE_S),
            Some(down) => {
                let below = down - led - 1;
                let flux_t = if below == 0 { turned_t } else { step_t };
                (self.points - 2 * below, 2, flux_t, SLOPE_S)
            }
        };
        // The mirrored point has the same flux as the first.
        let flux_t = if mirrored { SETTLE_T } else { flux_t.max(SETTLE_T) };
        let settle_s = SETTLE_S.max(flux_t * self.tau_r);
        Point {
            n,
            lead,
            mirrored,
            settle_s,
            average_s,
            turns: lead == 0 && n + Self::TURNING > self.first,
        }
    }
}
