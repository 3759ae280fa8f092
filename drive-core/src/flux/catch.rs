//! Flying start: the speed of the rotor from the decay of its flux.
//!
//! A step of the d-axis current I leaves a rotor flux that decays and rotates with the rotor, whether or not there was a flux
//! before:
//!
//! ```text
//! dpsi/dt = -(alpha - j w_r) psi + R_R I         lambda = sum e     (e: see the observer)
//! D_L[n]  = lambda[n] - 2 lambda[n-L] + lambda[n-2L]                 takes out offset and drift
//! C_L     = sum D_L[n] conj(D_L[n-L])     P_L = sum |D_L[n]|^2       w_L = arg C_L / (L T)
//! ```
//!
//! with T = 667 us, the mean of four periods, and L = 4, 10 and 48. The short lag shows by how many turns the longer one is
//! ambiguous. The long lag distinguishes slow rotors from noise, for which |C| is 0.67 P with half a turn. In simulation with
//! 2.5 A, the speed is found within 11 rpm up to 2700 rpm with four poles.
//!
//! Where the speed is known from the run before, or is higher than a fixed frame shows, the current stands in a frame that rotates with
//! w. A residual flux shows its speed in it by the same correlation. Without one, the flux of the current settles, and its voltage shows the
//! slip s = w - w_r:
//!
//! ```text
//! psi = L_M i/(1 + jx)     x = s tau_r     e/T = j w psi
//! z = e/(j w T L_M i)      x = -Im z/Re z                          if Re z > |Im z| and Re z > 0.2
//!                          x = (1 + sqrt(1 - 4 (Im z)^2))/(-2 Im z)   otherwise
//! ```
//!
//! The second form needs no real part, in which an error of the leakage acts. The next frame rotates with w - s, until |x| < 2. A frame that is
//! faster than the rotor drives it rather than brakes it. In simulation this finds a spindle at 400 Hz, and one that has slowed from there to
//! 10 Hz.

use core::f32::consts::TAU;

use crate::blocks::Catch;
use crate::math::within;
use crate::{Angle, Dq, Motor, PERIOD_S};

/// Control periods per average.
const AVERAGED: u8 = 4;
/// The lags, in averages, each with its least |C| relative to P.
const SHORT: (usize, f32) = (4, 0.5);
const MIDDLE: (usize, f32) = (10, 0.85);
const LONG: (usize, f32) = (48, 0.7);
/// Averages that are kept: three times the longest lag.
const KEPT: usize = 3 * LONG.0 + 1;
/// Control periods until the current has settled: 20 ms.
pub const FROM: u32 = 120;
/// Control periods of the brief search: 80 ms. In simulation 700 power-ups run in the sense of the shaft with it. With 60 ms, noise at rest looks
/// like rotation more often.
pub const BRIEF: u32 = 480;
/// Highest frequency that the short lag can measure, frequency above which the short lag alone is used, and lowest frequency that
/// counts as rotating, electrical turns per period.
const HIGHEST: f32 = 151.0 * PERIOD_S;
const FAST: f32 = 75.0 * PERIOD_S;
const LOWEST: f32 = 0.32 * PERIOD_S;

/// Least real part of z of a rotor that is near; the noise alone has a tenth.
const LEAST_LEAD: f32 = 0.2;
/// Share of the newest value in the latest voltage: 5 ms.
const LATEST: f32 = 1.0 / 30.0;

/// Sums of one lag.
#[derive(Clone, Copy, Debug, Default)]
struct Correlation {
    re: f32,
    im: f32,
    power: f32,
}

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SearchResult {
    /// The search continues.
    Searching,
    /// The shaft is at rest, or rotates so slowly that a normal start is possible.
    Standing,
    /// The shaft rotates, and its flux rotates at this speed, electrical turns per period.
    Turning(f32),
}

/// Path of the current that the rotating flux drives through rotor, stator and proportional controller,
/// `Z = k_c e^(-1.5 jwT) + r_s + jw sigma L_s`. This current turns the flux back, so the rotor is faster by the factor
/// `1 + R_R Re(1/Z)` than the flux.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Path {
    r_r: f32,
    /// Resistance k_c + r_s, ohm.
    pub resistance: f32,
    /// Reactance per frequency in turns per period, ohm.
    reactance: f32,
    /// Inductance L_M, H, and T alpha.
    coupled: f32,
    rate: f32,
}

impl Path {
    /// Creates the path with a controller of the gain `k_c`, V/A.
    pub fn new(motor: &Motor, k_c: f32) -> Self {
        Self {
            r_r: motor.coupled_inductance() / motor.tau_r(),
            resistance: k_c + motor.r_s,
            reactance: TAU * (motor.sigma_l_s() / PERIOD_S - 1.5 * k_c),
            coupled: motor.coupled_inductance(),
            rate: PERIOD_S / motor.tau_r(),
        }
    }

    /// Returns the speed of the rotor from the speed of its flux, electrical turns per period.
    pub fn rotor(&self, freq: f32) -> f32 {
        let (r, x) = (self.resistance, self.reactance * freq);
        freq * (1.0 + self.r_r * r / (r * r + x * x))
    }
}

/// Coefficients of the flying start, in control periods and A.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FlyingStart {
    /// See [`blocks`](crate::blocks).
    pub built: Catch,
    /// D-axis current of the speed search, A.
    pub search_current: f32,
    /// Largest d-axis current while the flux builds up, A.
    pub current: f32,
    /// Periods of the search in a frame that is fixed, and in one that rotates.
    pub search: [u32; 2],
    /// Frequency of the frames in which an unknown speed is looked for, beside the fixed one, electrical turns per period; 0 for none.
    pub fastest: f32,
    /// Slip relative to a rotating frame up to which the flux builds up there, electrical turns per period.
    pub near: f32,
    /// Periods in which the injection alone corrects the angle.
    pub injection_only: u32,
    /// Periods in which the flux builds up.
    pub build_up: u32,
    /// Periods after which no flux is left in a motor that was switched off.
    pub flux_decay: u32,
    /// Model that the search subtracts from the voltage.
    pub path: Path,
    /// Largest voltage of the residual flux, V.
    pub residual_v: f32,
    /// Decay of that flux per period.
    pub decay: f32,
}

/// One frame of a search.
#[derive(Clone, Copy, Debug)]
pub struct Try {
    /// See [`blocks`](crate::blocks).
    pub _built: Catch,
    /// Origin of its frequency.
    pub from: Origin,
    /// Frequency of the frame, electrical turns per period.
    pub freq: f32,
    /// Number of times that the frame has followed the speed found in it.
    pub steps: u8,
}

/// Frames of a search, in the order in which they are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Origin {
    /// The frame rotates with the shaft as it was at the end of the run before.
    Run,
    /// The highest speed, in either sense.
    Forward,
    Backward,
    /// The frame is fixed, for a short time and with a small current, which brakes a light shaft but little. Then the frame rotates with the
    /// speed found.
    Brief,
    /// The frame is fixed.
    Fixed,
}

/// State of the search.
#[derive(Clone, Copy, Debug)]
pub struct CatchState {
    /// The frame.
    pub at: Try,
    /// Sum of e, V s, and sum of its values in the present average.
    flux: Dq,
    sum: Dq,
    summed: u8,
    kept: [Dq; KEPT],
    count: usize,
    correlations: [Correlation; 3],
    /// Sums of e, V s, and of the current, A, in the second half of a search in a rotating frame.
    settled: [Dq; 2],
    /// Mean of e in the last injection periods, V s.
    latest: Dq,
}

impl CatchState {
    /// Begins a search in this frame.
    pub fn new(at: Try) -> Self {
        Self {
            at,
            flux: Dq::ZERO,
            sum: Dq::ZERO,
            summed: 0,
            kept: [Dq::ZERO; KEPT],
            count: 0,
            correlations: [Correlation::default(); 3],
            settled: [Dq::ZERO; 2],
            latest: Dq::ZERO,
        }
    }

    /// Takes the voltage `e` of the rotor, V s, and the current, A, in period `elapsed` of a search in a rotating frame.
    pub fn settle(&mut self, elapsed: u32, end: u32, e: Dq, current: Dq) {
        self.latest += (e - self.latest) * LATEST;
        if elapsed >= end / 2 {
            self.settled[0] += e;
            self.settled[1] += current;
        }
    }

    /// Returns the speed of the rotating frame less that of the rotor, electrical turns per period.
    pub fn slip(&self, path: &Path) -> f32 {
        let [e, i] = self.settled;
        let per = 1.0 / (TAU * self.at.freq * path.coupled * i.length_squared());
        let (leads, lags) = (per * (e.q * i.d - e.d * i.q), per * (e.d * i.d + e.q * i.q));
        let x = if leads > lags.abs() && leads > LEAST_LEAD {
            lags / leads
        } else {
            let root = fpu_sqrt::sqrtf(within(1.0 - 4.0 * lags * lags, (0.0, 1.0)));
            0.5 * (1.0 + root) / lags
        };
        x * path.rate * (1.0 / TAU)
    }

    /// Takes the voltage `e` of the rotor in period `elapsed` of the search, V s in a fixed frame. From [`FROM`] on
    /// the controller is proportional.
    /// The search ends with the period `end`.
    pub fn step(&mut self, elapsed: u32, end: u32, e: Dq) -> SearchResult {
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
        if elapsed < end { SearchResult::Searching } else { self.result() }
    }

    /// Returns the flux at the end of a search in a rotating frame, V s.
    pub fn flux(&self) -> f32 {
        fpu_sqrt::sqrtf(self.latest.length_squared()) / (TAU * self.at.freq.abs())
    }

    /// Returns the angle by which the flux leads the rotating frame at the end.
    pub fn lead(&self) -> Angle {
        // psi = e/(j w)
        let sign = if self.at.freq < 0.0 { -1.0 } else { 1.0 };
        direction(Dq { d: sign * self.latest.q, q: -sign * self.latest.d })
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
                // The short lag shows the number of turns within the middle lag.
                const TURN: f32 = 1.0 / (MIDDLE.0 * AVERAGED as usize) as f32;
                let turns = (near - far) * (1.0 / TURN);
                far + (turns + if turns < 0.0 { -0.5 } else { 0.5 }) as i32 as f32 * TURN
            }
            // The long lag shows the remainder of a turn only and is not used here; noise alone is half a turn.
            (Some(near), None, _) if near.abs() > FAST && near.abs() < HIGHEST => near,
            (_, Some(freq), _) | (_, _, Some(freq)) => freq,
            _ => 0.0,
        };
        if freq.abs() < LOWEST { SearchResult::Standing } else { SearchResult::Turning(freq) }
    }
}

impl Correlation {
    /// Adds the average with the number `count`.
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

    /// Returns the frequency, electrical turns per period, if it is more than noise.
    fn frequency(&self, (lag, least): (usize, f32)) -> Option<f32> {
        let least = least * self.power;
        if self.re * self.re + self.im * self.im <= least * least {
            return None;
        }
        let turn = direction(Dq { d: self.re, q: self.im });
        Some(turn.to_turns() / (lag * usize::from(AVERAGED)) as f32)
    }
}

/// Returns the angle of a vector.
fn direction(of: Dq) -> Angle {
    let (d, q) = (of.d.abs(), of.q.abs());
    // The scale keeps the numbers within the range of integers.
    let scale = 1e9 / if d > q { d } else { q };
    Angle::from_bits(idsp::atan2((of.q * scale) as i32, (of.d * scale) as i32))
}
