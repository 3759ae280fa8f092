//! Start on a turning shaft: the speed of the rotor from the decay of its flux.
//!
//! A step of direct current I into a motor leaves a rotor flux that decays and turns with the rotor, whether or not there was
//! flux before:
//!
//! ```text
//! dpsi/dt = -(alpha - j w_r) psi + R_R I         lambda = sum e     (e: see the observer)
//! D_L[n]  = lambda[n] - 2 lambda[n-L] + lambda[n-2L]                 takes out offset and drift
//! C_L     = sum D_L[n] conj(D_L[n-L])     P_L = sum |D_L[n]|^2       w_L = arg C_L / (L T)
//! ```
//!
//! with T = 667 us, the mean of four periods, and L = 4, 10 and 48: the short lag tells how often the long one has turned, the
//! long one tells slow rotors from noise, of which |C| is 0.67 P with half a turn. Simulated, 2.5 A: found within 21 rpm up to
//! 2700 rpm on four poles.

use crate::io::PERIOD_S;
use crate::math::angle::Angle;
use crate::math::frames::Dq;

/// Control periods that are averaged.
const AVERAGED: u8 = 4;
/// The lags, averages.
const LAGS: [usize; 3] = [4, 10, 48];
/// Averages that are kept: the longest lag three times.
const KEPT: usize = 3 * LAGS[2] + 1;
/// Control periods until the current stands, and until the end: 20 and 250 ms.
const FROM: u32 = 120;
const END: u32 = 1500;
/// Least |C| relative to P of each lag.
const LEAST: [f32; 3] = [0.5, 0.85, 0.7];
/// Highest frequency that the short lag tells, and the lowest that counts as turning, electrical turns per period.
const HIGHEST: f32 = 151.0 * PERIOD_S;
const LOWEST: f32 = 0.32 * PERIOD_S;

/// Sums of one lag.
#[derive(Clone, Copy, Debug, Default)]
struct Correlation {
    re: f32,
    im: f32,
    power: f32,
}

/// State of the search.
#[derive(Clone, Copy, Debug)]
pub struct CatchState {
    /// Sum of e, V s, and of its values in the present average.
    flux: Dq,
    sum: Dq,
    summed: u8,
    kept: [Dq; KEPT],
    count: usize,
    correlations: [Correlation; LAGS.len()],
}

impl Default for CatchState {
    fn default() -> Self {
        Self {
            flux: Dq::ZERO,
            sum: Dq::ZERO,
            summed: 0,
            kept: [Dq::ZERO; KEPT],
            count: 0,
            correlations: Default::default(),
        }
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Caught {
    /// The search goes on.
    Searching,
    /// The shaft stands, or turns so slowly that a start does not mind.
    Standing,
    /// The rotor turns at this speed, electrical turns per period.
    Turning(f32),
}

impl CatchState {
    /// Takes the rotor's voltage `e` of period `elapsed` of the search, V s in a frame that stands.
    pub fn step(&mut self, elapsed: u32, e: Dq) -> Caught {
        if elapsed < FROM {
            return Caught::Searching;
        }
        self.flux += e;
        self.sum += self.flux;
        self.summed += 1;
        if self.summed == AVERAGED {
            self.take();
            (self.sum, self.summed) = (Dq::ZERO, 0);
        }
        if elapsed < END { Caught::Searching } else { self.result() }
    }

    /// Takes an average.
    fn take(&mut self) {
        if let Some(place) = self.kept.get_mut(self.count % KEPT) {
            *place = self.sum;
        }
        for (lag, sums) in LAGS.into_iter().zip(&mut self.correlations) {
            if self.count < 3 * lag {
                continue;
            }
            let at = |lags: usize| {
                let place = self.kept.get((self.count - lags * lag) % KEPT);
                place.copied().unwrap_or(Dq::ZERO)
            };
            let (one, two) = (at(1), at(2));
            let now = at(0) - one * 2.0 + two;
            let before = one - two * 2.0 + at(3);
            sums.re += now.d * before.d + now.q * before.q;
            sums.im += now.q * before.d - now.d * before.q;
            sums.power += now.length_squared();
        }
        self.count += 1;
    }

    fn result(&self) -> Caught {
        let [short, middle, long] = self.correlations;
        let [w_short, w_middle, w_long] = [(short, 0), (middle, 1), (long, 2)].map(frequency);
        let [by_short, by_middle, by_long] = [(short, 0), (middle, 1), (long, 2)].map(is_sound);
        let freq = if by_short && w_short.abs() < HIGHEST {
            // Turns of the middle lag that the short one sees.
            let turn = 1.0 / (LAGS[1] * AVERAGED as usize) as f32;
            let turns = (w_short - w_middle) * (1.0 / turn);
            w_middle + turn * (turns + if turns < 0.0 { -0.5 } else { 0.5 }) as i32 as f32
        } else if by_middle {
            w_middle
        } else if by_long {
            w_long
        } else {
            0.0
        };
        if freq.abs() < LOWEST { Caught::Standing } else { Caught::Turning(freq) }
    }
}

/// Frequency of a lag, electrical turns per period.
fn frequency((sums, lag): (Correlation, usize)) -> f32 {
    let largest = if sums.re.abs() > sums.im.abs() { sums.re.abs() } else { sums.im.abs() };
    // Within the range of whole numbers.
    let scale = 1e9 / largest;
    let turn = Angle::from_bits(idsp::atan2((sums.im * scale) as i32, (sums.re * scale) as i32));
    turn.to_turns() / (LAGS[lag] * usize::from(AVERAGED)) as f32
}

fn is_sound((sums, lag): (Correlation, usize)) -> bool {
    let least = LEAST[lag] * sums.power;
    sums.re * sums.re + sums.im * sums.im > least * least
}
