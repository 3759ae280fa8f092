//! Sums over the samples of a test signal. They are small and of fixed size, so that memory can be lent for them.
//!
//! Sample `k` of the current is paired with the mean of the voltages of the steps `k-2` and `k-1`: the voltage of step
//! `k-1` acts from `k` on, and the voltage of step `k-2` ends at `k`.

use super::motion::{Motion, Ringing};
use super::plant_fit::PlantFit;
use drive_core::carrier::{CARRIER_COS, CARRIER_SAMPLES, CARRIER_SIN};
use drive_core::{Abc, AlphaBeta, PERIOD_S};
use num_complex::Complex32;

/// Bins of a record.
pub const BINS: usize = 57;
/// Every bin is longer than the one before by this factor.
const GROWTH: f32 = 1.09;
/// Total length of all bins, in lengths of the first: (1.09^57 - 1) / 0.09.
pub(super) const FIRST_BINS: f32 = 1501.0;

/// Kind of record.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Record {
    /// Nothing is recorded; the bins keep their contents.
    #[default]
    Nothing,
    /// Means in bins of which each is 9 % longer than the one before, in one half of the memory.
    Bins {
        /// The half, 0 or 1.
        half: usize,
        /// Length of the first bin, control periods.
        first: f32,
    },
    /// Products of voltage and current with the cosine and sine of the injection.
    Carrier,
    /// Means and squares of the phase currents and of the dc link.
    Noise,
    /// Least-squares fit of the plant of the current loop.
    Plant {
        /// Whether the voltage lies across phase a, or along it.
        across: bool,
        /// Amplitude of the voltage, V, and of the current that a sample of it makes, A: the bases of the fit.
        bases: (f32, f32),
    },
    /// Q-axis current and speed, by [`push_motion`](Collector::push_motion).
    Motion,
    /// The speed after an impulse of torque, by [`push_motion`](Collector::push_motion).
    Ringing,
}

impl Record {
    /// Returns a record in bins that last so many seconds in all.
    pub(super) fn bins(half: usize, seconds: f32) -> Self {
        Self::Bins { half, first: seconds / PERIOD_S / FIRST_BINS }
    }
}

/// Means over a bin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Its length, control periods.
    pub periods: f32,
    /// Mean voltage along phase a, V.
    pub voltage: f32,
    /// Mean current, A.
    pub current: AlphaBeta,
}

impl Bin {
    /// Returns the means, if `self` holds sums over `periods`.
    fn mean(&self) -> Self {
        let share = 1.0 / self.periods;
        Self { voltage: self.voltage * share, current: self.current * share, ..*self }
    }
}

/// Collects the sums.
///
/// Call [`begin`](Self::begin) before the command that changes the excitation, and [`push`](Self::push) for every step of
/// the drive while it [applies a test signal](drive_core::Drive::is_testing). The size is 2 KiB.
#[derive(Clone, Debug)]
pub struct Collector {
    pub(super) recorded: Recorded,
    /// Voltages of the last two steps.
    voltages: [AlphaBeta; 2],
    /// Sums of length, voltage and current of each bin; they stay until another record takes their half of the memory.
    bins: [[Bin; BINS]; 2],
}

/// Contents of a record since it began.
#[derive(Clone, Debug, Default)]
pub(super) struct Recorded {
    record: Record,
    pub samples: u32,
    /// Whether samples are missing.
    pub incomplete: bool,
    /// Index of the bin that is being filled, its length, and the sample at which it ends.
    bin: usize,
    length: f32,
    end: f32,
    /// Products of the cosine and the sine of the injection with the voltage along phase a and across it, and with the current
    /// along and across it.
    carrier: [[f32; 2]; 4],
    /// Sums of the phase currents a and b, of their squares, and of the dc link less its first value.
    noise: [f32; 5],
    first_dc_link: f32,
    pub motion: Motion,
    pub ringing: Ringing,
    pub plant: PlantFit,
}

impl Default for Collector {
    fn default() -> Self {
        let bins = [[Bin::default(); BINS]; 2];
        Self { recorded: Recorded::default(), voltages: [AlphaBeta::ZERO; 2], bins }
    }
}

impl Collector {
    /// Begins a record.
    pub fn begin(&mut self, record: Record) {
        self.recorded = Recorded { record, ..Recorded::default() };
        if let Record::Bins { half, first } = record {
            (self.recorded.end, self.recorded.length) = (first, first);
            if let Some(bins) = self.bins.get_mut(half) {
                *bins = [Bin::default(); BINS];
            }
        }
    }

    /// Notes that steps of the drive are missing between the last and the next, so that a record that has begun is incomplete.
    pub fn gap(&mut self) {
        let sums = &mut self.recorded;
        sums.incomplete |= sums.samples > 0 && sums.record != Record::Nothing;
    }

    /// Takes a step of the drive while it regulates torque: the q-axis current reference, A, and `rotor_freq` of its
    /// [telemetry](drive_core::Telemetry).
    pub fn push_motion(&mut self, i_q: f32, rotor_freq: f32) {
        let sums = &mut self.recorded;
        match sums.record {
            Record::Motion => sums.motion.push(i_q, rotor_freq),
            Record::Ringing => sums.ringing.push(rotor_freq),
            _ => return,
        }
        sums.samples = sums.samples.wrapping_add(1);
    }

    /// Takes a step of the drive while it applies the test signal: `measured`, `realised` and `dc_link` of its
    /// [telemetry](drive_core::Telemetry).
    pub fn push(&mut self, measured: AlphaBeta, realised: AlphaBeta, dc_link: f32) {
        let ([last, before], sums) = (self.voltages, &mut self.recorded);
        match sums.record {
            Record::Motion | Record::Ringing => return,
            Record::Nothing => {}
            Record::Bins { half, .. } => {
                // The last bin goes on until the next record.
                while sums.samples as f32 >= sums.end && sums.bin + 1 < BINS {
                    sums.bin += 1;
                    sums.length *= GROWTH;
                    sums.end += sums.length;
                }
                let voltage = 0.5 * (last.alpha + before.alpha);
                if let Some(bin) = self.bins.get_mut(half).and_then(|bins| bins.get_mut(sums.bin)) {
                    bin.periods += 1.0;
                    bin.voltage += voltage;
                    bin.current += measured;
                }
            }
            Record::Plant { across, bases } => {
                let axis = |x: AlphaBeta| if across { x.beta } else { x.alpha };
                sums.plant.push(axis(realised) / bases.0, axis(measured) / bases.1);
            }
            Record::Carrier => {
                let at = sums.samples as usize % CARRIER_SAMPLES;
                let seen = [realised.alpha, realised.beta, measured.alpha, measured.beta];
                for ([re, im], x) in sums.carrier.iter_mut().zip(seen) {
                    *re += CARRIER_COS[at] * x;
                    *im += CARRIER_SIN[at] * x;
                }
            }
            Record::Noise => {
                if sums.samples == 0 {
                    sums.first_dc_link = dc_link;
                }
                let Abc { a, b, .. } = measured.to_abc();
                let terms = [a, b, a * a, b * b, dc_link - sums.first_dc_link];
                sums.noise.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
        }
        self.voltages = [realised, last];
        sums.samples = sums.samples.wrapping_add(1);
    }

    /// Returns the bins of a half of the memory that have samples, in their order.
    pub fn bins(&self, half: usize) -> impl Iterator<Item = Bin> + Clone + '_ {
        let filled = self.bins.get(half).into_iter().flatten().filter(|bin| bin.periods > 0.0);
        filled.map(Bin::mean)
    }

    /// Returns the mean over the bins of a half from the given one on.
    pub(super) fn mean(&self, half: usize, from: usize) -> Bin {
        let mut sum = Bin::default();
        for bin in self.bins(half).skip(from) {
            sum.periods += bin.periods;
            sum.voltage += bin.voltage * bin.periods;
            sum.current += bin.current * bin.periods;
        }
        sum.mean()
    }

    /// Returns the phasors at the injection frequency (cosine and sine part): voltage along phase a and across it, V peak, then
    /// current along and across, A peak.
    pub(super) fn phasors(&self) -> [Complex32; 4] {
        let share = 2.0 / self.recorded.samples as f32;
        self.recorded.carrier.map(|[cos, sin]| share * Complex32::new(cos, -sin))
    }

    /// Returns the noise of the sensors a and b without current, A rms, and the dc link, V.
    pub(super) fn quiet(&self) -> ([f32; 2], f32) {
        let share = 1.0 / self.recorded.samples as f32;
        let [a, b, aa, bb, dc_link] = self.recorded.noise.map(|sum| share * sum);
        let rms = |square: f32, mean: f32| fpu_sqrt::sqrtf(square - mean * mean);
        ([rms(aa, a), rms(bb, b)], self.recorded.first_dc_link + dc_link)
    }
}
