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
//! long one tells slow rotors from noise, of which |C| is 0.67 P with half a turn. Simulated, 2.5 A: found within 11 rpm up to
//! 2700 rpm on four poles.

use core::f32::consts::TAU;

use crate::{Angle, Dq, Motor, PERIOD_S};

/// Control periods that are averaged.
const AVERAGED: u8 = 4;
/// The lags, averages, each with the least |C| relative to P.
const SHORT: (usize, f32) = (4, 0.5);
const MIDDLE: (usize, f32) = (10, 0.85);
const LONG: (usize, f32) = (48, 0.7);
/// Averages that are kept: the longest lag three times.
const KEPT: usize = 3 * LONG.0 + 1;
/// Control periods until the current stands, and until the end: 20 and 250 ms.
pub const FROM: u32 = 120;
const END: u32 = 1500;
/// Highest frequency that the short lag tells, from which on it is believed alone, and the lowest that counts as turning, electrical
/// turns per period.
const HIGHEST: f32 = 151.0 * PERIOD_S;
const FAST: f32 = 75.0 * PERIOD_S;
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
    correlations: [Correlation; 3],
}

impl Default for CatchState {
    fn default() -> Self {
        Self {
            flux: Dq::ZERO,
            sum: Dq::ZERO,
            summed: 0,
            kept: [Dq::ZERO; KEPT],
            count: 0,
            correlations: [Correlation::default(); 3],
        }
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SearchResult {
    /// The search goes on.
    Searching,
    /// The shaft stands, or turns so slowly that a start does not mind.
    Standing,
    /// The flux of a turning rotor turns at this speed, electrical turns per period.
    Turning(f32),
}

/// Path of the current that the turning flux drives through rotor, stator and proportional controller, `Z = k_c e^(-1.5 jwT) + r_s +
/// jw sigma L_s`. The current turns the flux back: the rotor turns by `1 + R_R Re(1/Z)` faster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    r_r: f32,
    /// k_c + r_s, ohm.
    pub resistance: f32,
    /// By the frequency in turns per period.
    reactance: f32,
}

impl Path {
    /// With a controller of the gain `k_c`, V/A.
    pub fn new(motor: &Motor, k_c: f32) -> Self {
        Self {
            r_r: motor.coupled_inductance() / motor.tau_r(),
            resistance: k_c + motor.r_s,
            reactance: TAU * (motor.sigma_l_s() / PERIOD_S - 1.5 * k_c),
        }
    }

    /// Speed of the rotor by that of its flux, electrical turns per period.
    pub fn rotor(&self, freq: f32) -> f32 {
        let (r, x) = (self.resistance, self.reactance * freq);
        freq * (1.0 + self.r_r * r / (r * r + x * x))
    }
}

impl CatchState {
    /// Takes the rotor's voltage `e` of period `elapsed` of the search, V s in a frame that stands. From [`FROM`] on
    /// the controller is proportional.
    pub fn step(&mut self, elapsed: u32, e: Dq) -> SearchResult {
        if elapsed < FROM {
            return SearchResult::Searching;
        }
        self.flux += e;
        self.sum += self.flux;
        self.summed += 1;
        if self.summed == AVERAGED {
            self.take();
            (self.sum, self.summed) = (Dq::ZERO, 0);
        }
        if elapsed < END { SearchResult::Searching } else { self.result() }
    }

    /// Takes an average.
    fn take(&mut self) {
        self.kept[self.count % KEPT] = self.sum;
        for (sums, (lag, _)) in self.correlations.iter_mut().zip([SHORT, MIDDLE, LONG]) {
            sums.add(lag, &self.kept, self.count);
        }
        self.count += 1;
    }

    fn result(&self) -> SearchResult {
        let [short, middle, long] = &self.correlations;
        let (by_short, by_middle) = (short.frequency(SHORT), middle.frequency(MIDDLE));
        let freq = match (by_short, by_middle, long.frequency(LONG)) {
            (Some(near), Some(far), _) if near.abs() < HIGHEST => {
                // Turns within the middle lag that the short one sees.
                const TURN: f32 = 1.0 / (MIDDLE.0 * AVERAGED as usize) as f32;
                let turns = (near - far) * (1.0 / TURN);
                far + (turns + if turns < 0.0 { -0.5 } else { 0.5 }) as i32 as f32 * TURN
            }
            // Not the remainder that the long lag sees; noise alone is half a turn.
            (Some(near), None, _) if near.abs() > FAST && near.abs() < HIGHEST => near,
            (_, Some(freq), _) | (_, _, Some(freq)) => freq,
            _ => 0.0,
        };
        if freq.abs() < LOWEST { SearchResult::Standing } else { SearchResult::Turning(freq) }
    }
}

impl Correlation {
    /// Adds the average `count` of those that are kept.
    fn add(&mut self, lag: usize, kept: &[Dq; KEPT], count: usize) {
        if count < 3 * lag {
            return;
        }
        let at = |lags: usize| kept[(count - lags * lag) % KEPT];
        let (one, two) = (at(1), at(2));
        let now = at(0) - one * 2.0 + two;
        let before = one - two * 2.0 + at(3);
        self.re += now.d * before.d + now.q * before.q;
        self.im += now.q * before.d - now.d * before.q;
        self.power += now.length_squared();
    }

    /// Electrical turns per period, where it is more than noise.
    fn frequency(&self, (lag, least): (usize, f32)) -> Option<f32> {
        let least = least * self.power;
        if self.re * self.re + self.im * self.im <= least * least {
            return None;
        }
        let (re, im) = (self.re.abs(), self.im.abs());
        // Within the range of whole numbers.
        let scale = 1e9 / if re > im { re } else { im };
        let turn = idsp::atan2((self.im * scale) as i32, (self.re * scale) as i32);
        Some(Angle::from_bits(turn).to_turns() / (lag * usize::from(AVERAGED)) as f32)
    }
}
