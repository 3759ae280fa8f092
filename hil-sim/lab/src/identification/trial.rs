//! One simulated measurement of section 5: machine at constant speed, noise, filters.

use nalgebra::Vector2;

use super::signals::{Filter, noise, six_step, six_step_and_schroeder};
use super::{Complex, Data, Parameters};
use crate::prelude::*;

/// Simulation step of the paper, s.
pub const FINE: f64 = 5e-6;
/// Order of the series in the paper.
pub const ORDER: u32 = 5;
/// Amplitude of the six-step voltage, V. The errors in % do not depend on it.
pub const VOLTAGE: f64 = 180.0;
/// Corner of the filters divided by the frequency of the supply, omega_n/omega_s.
pub const CORNER: f64 = 5.0;
/// Time that the machine runs before recording starts, s.
const WARM_UP: f64 = 1.0;
/// Samples that pass the filters before the first one is used.
const DISCARDED: usize = 2000;

/// The two excitations of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// S_g: six-step.
    SixStep,
    /// S_s: six-step plus Schroeder.
    Schroeder,
}

impl Signal {
    /// Both excitations, in the order of the tables.
    pub const ALL: [Self; 2] = [Self::SixStep, Self::Schroeder];

    /// Returns `Sg` or `Ss`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SixStep => "Sg",
            Self::Schroeder => "Ss",
        }
    }

    /// Voltage at `t` s for a fundamental of `hz`, V.
    pub fn at(self, hz: f64, t: f64) -> Complex {
        match self {
            Self::SixStep => six_step(VOLTAGE, hz, t),
            Self::Schroeder => six_step_and_schroeder(VOLTAGE, hz, t),
        }
    }
}

/// Largest noise relative to the largest value of either axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Relative noise of the voltage.
    pub voltage: f64,
    /// Relative noise of the current.
    pub current: f64,
}

impl Noise {
    /// No noise.
    pub const NONE: Self = Self { voltage: 0.0, current: 0.0 };
    /// r_v and r_i as section 5 prints them: up to 5 % and 20 % in either direction.
    pub const PRINTED: Self = Self { voltage: 0.05, current: 0.2 };
    /// Noise as with a real ADC: a tenth of the printed noise.
    pub const TENTH: Self = Self { voltage: 0.005, current: 0.02 };
    /// r_v and r_i read as peak to peak. The results are closer to Tables 1 to 3, but this contradicts the words of the
    /// paper; it was chosen by comparison with those same tables.
    pub const HALF: Self = Self { voltage: 0.025, current: 0.1 };
}

/// Largest voltage and largest current of either axis, V and A.
pub fn peaks(samples: impl Iterator<Item = (Complex, Complex)>) -> [f64; 2] {
    let larger = |peak: f64, x: Complex| peak.max(x.re.abs()).max(x.im.abs());
    samples.fold([0.0; 2], |[peak_v, peak_i], (v, i)| [larger(peak_v, v), larger(peak_i, i)])
}

/// A simulated measurement.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// The machine and its speed.
    pub machine: Parameters,
    /// The excitation.
    pub signal: Signal,
    /// Fundamental of the excitation f_s, Hz.
    pub hz: f64,
    /// Sampling period h, s: a multiple of 5 µs.
    pub h: f64,
    /// Measurement noise.
    pub noise: Noise,
    /// Number of samples that are used, N.
    pub samples: usize,
}

impl Trial {
    /// The simulated measurement of the paper at this speed (60 Hz above 200 rad/s, otherwise 10 Hz): 4000 samples.
    pub fn printed(machine: Parameters, signal: Signal, h: f64, noise: Noise) -> Self {
        let hz = if machine.omega_m > 200.0 { 60.0 } else { 10.0 };
        Self { machine, signal, hz, h, noise, samples: 4000 }
    }

    /// Voltage and current at every sample, without end, starting with zero current.
    pub fn raw(&self) -> impl Iterator<Item = (Complex, Complex)> + use<> {
        let Self { machine, signal, hz, h, .. } = *self;
        let fine = (h / FINE).round().max(1.0);
        // The voltage is held, so the fine steps of a period form one linear map.
        let step = machine.continuous().series(h / fine, ORDER).repeated(fine as u32);
        let mut x = Vector2::zeros();
        (0u64..).map(move |k| {
            let v = signal.at(hz, k as f64 * h);
            let sample = (v, x[0]);
            x = step.advance(x, v);
            sample
        })
    }

    /// Voltage and current with noise, after the filters; machine and filters have settled.
    pub fn run(&self, seed: u64, m: u64) -> Data {
        let warm_up = (WARM_UP / self.h).round() as usize;
        let length = self.samples + DISCARDED;
        let clean: Vec<_> = self.raw().skip(warm_up).take(length).collect();
        let [peak_v, peak_i] = peaks(clean.iter().copied());
        let (largest_v, largest_i) = (self.noise.voltage * peak_v, self.noise.current * peak_i);
        let mut rng =
            Xoshiro256PlusPlus::seed_from_u64(seed.wrapping_mul(0x9E37_79B9).wrapping_add(m));
        let filter = Filter::new(CORNER * TAU * self.hz, self.h);
        let (mut on_v, mut on_i) = (filter, filter);
        let mut data = Data::default();
        for (n, (v, i)) in clean.into_iter().enumerate() {
            let v = on_v.step(v + noise(&mut rng, largest_v));
            let i = on_i.step(i + noise(&mut rng, largest_i));
            if n >= DISCARDED {
                data.v.push(v);
                data.i.push(i);
            }
        }
        data
    }
}
