//! Errors of the measurement that most boards do not have. They are in a layer of their own, so that boards without
//! them lose no time (as cold code: 4 ns of 285 a period).

use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{MeasurementSettings, coefficients};

/// The errors of channels A and B, with their state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CurrentErrors {
    /// Shares of the current of the other phase.
    cross_talk: [f64; 2],
    /// Coefficient of the error that grows with the square of the current, 1/A^2.
    cubic: [f64; 2],
    /// Drift of the offsets, A/s.
    drift: [f64; 2],
    /// Time since the start, s.
    time: f64,
    /// Time constant of the lag of channel B, s; 0 for no lag.
    lag_b: f64,
    lagging_b: [f64; 3],
    /// Current of phase b before and after that lag.
    before_b: f64,
    behind_b: f64,
    /// Time from now to the middle of the last pulse, s.
    until_middle: f64,
    /// Present input of the channels.
    now: [f64; 2],
    /// Input of the channels in the middle of the last pulse, if that is converted as well.
    middle: Option<[f64; 2]>,
}

impl CurrentErrors {
    /// Makes these errors; none if all of them are zero.
    pub(super) fn new(s: &MeasurementSettings) -> Option<Self> {
        let errors = Self {
            cross_talk: [s.cross_talk_a, s.cross_talk_b],
            cubic: s.calibration().map(|line| s.cubic_error / (line.a_at_zero * line.a_at_zero)),
            drift: [s.drift_a, s.drift_b],
            time: 0.0,
            lag_b: s.lag_b_us * 1e-6,
            lagging_b: [0.0; 3],
            before_b: 0.0,
            behind_b: 0.0,
            until_middle: 0.0,
            now: [0.0; 2],
            middle: s.both_zero_vectors.then_some([0.0; 2]),
        };
        let sizes = [errors.cross_talk, errors.cubic, errors.drift, [errors.lag_b, 0.0]];
        let acts = errors.middle.is_some() || *sizes.as_flattened() != [0.0; 8];
        acts.then_some(errors)
    }

    /// Begins with these currents of phases a and b, A.
    pub(super) fn rest(&mut self, [a, b]: [f64; 2]) {
        (self.before_b, self.behind_b) = (b, b);
        self.now = self.crossed(a, b);
    }

    /// Adds the cross-talk to the currents of both channels, A.
    fn crossed(&self, a: f64, b: f64) -> [f64; 2] {
        [a + self.cross_talk[0] * b, b + self.cross_talk[1] * a]
    }

    /// Begins a period with this number of pulses; the middle is the middle of the last pulse.
    pub(super) fn begin(&mut self, period: f64, pulses: u16) {
        self.until_middle = period - 0.5 * period / f64::from(pulses);
    }

    /// Prepares steps of `h` seconds.
    pub(super) fn prepare(&mut self, h: f64) {
        if self.lag_b > 0.0 {
            self.lagging_b = coefficients(h / self.lag_b);
        }
    }

    /// Follows the currents of phases a and b, A, over `h` seconds; the arguments are the currents at their end.
    #[cold]
    pub(super) fn follow(&mut self, [a, b]: [f64; 2], h: f64) {
        self.time += h;
        let mut seen_b = b;
        if self.lag_b > 0.0 {
            let [pole, from_old, from_new] = self.lagging_b;
            self.behind_b = self.behind_b * pole + self.before_b * from_old + b * from_new;
            self.before_b = b;
            seen_b = self.behind_b;
        }
        self.now = self.crossed(a, seen_b);
        self.until_middle -= h;
        // The end of a step that is nearest to the middle.
        if self.until_middle.abs() <= 0.5 * h {
            self.middle = self.middle.map(|_| self.now);
        }
    }

    /// Returns the present readings of the channels, A, and those in the middle of the last pulse if that is converted as well.
    pub(super) fn currents(&self) -> ([f64; 2], Option<[f64; 2]>) {
        let bent = |seen: [f64; 2]| [0, 1].map(|k| seen[k] + self.cubic[k] * seen[k].powi(3));
        (bent(self.now), self.middle.map(bent))
    }

    /// Offsets by drift, A.
    pub(super) fn offsets(&self) -> [f64; 2] {
        self.drift.map(|drift| drift * self.time)
    }
}

/// The errors of the dc-link voltage, with their state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct VoltageErrors {
    gain: f64,
    /// Time constant of the lag, s; 0 for no lag.
    lag: f64,
    /// Pole of the lag, and the time step, s, for which it holds.
    pole: f64,
    step: f64,
    /// Voltage after the lag, V; not a number before the first period.
    seen: f64,
    /// Noise, V rms.
    noise: f64,
}

impl VoltageErrors {
    /// Makes these errors; none if all of them are zero.
    pub(super) fn new(s: &MeasurementSettings) -> Option<Self> {
        let acts = s.dc_gain_error != 0.0 || s.dc_lag_us > 0.0 || s.dc_noise_v > 0.0;
        acts.then_some(Self {
            gain: 1.0 + s.dc_gain_error,
            lag: s.dc_lag_us * 1e-6,
            pole: 0.0,
            step: f64::NAN,
            seen: f64::NAN,
            noise: s.dc_noise_v,
        })
    }

    /// Follows the voltage over `h` seconds; `vdc`, V, is the voltage at their end.
    pub(super) fn follow(&mut self, vdc: f64, h: f64) {
        if self.lag > 0.0 {
            if h != self.step {
                (self.step, self.pole) = (h, (-h / self.lag).exp());
            }
            let before = if self.seen.is_nan() { vdc } else { self.seen };
            self.seen = vdc + (before - vdc) * self.pole;
        }
    }

    /// Returns the reading of the voltage `vdc`, V.
    #[cold]
    pub(super) fn reading(&self, vdc: f64, rng: &mut Xoshiro256PlusPlus) -> f64 {
        let seen = self.gain * if self.seen.is_nan() { vdc } else { self.seen };
        if self.noise == 0.0 {
            return seen;
        }
        let unit: f64 = StandardNormal.sample(rng);
        seen + unit * self.noise
    }
}
