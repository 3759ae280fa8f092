//! Sums over the samples of an excitation: small, of fixed size, so that memory can be lent for them.
//!
//! Sample `k` of the current is paired with the mean of the voltages of the steps `k-2` and `k-1`: that of step `k-1` acts
//! from `k` on, that of `k-2` ended at `k`.

use super::motion::Motion;
use super::plant_fit::PlantFit;
use crate::carrier::injection::{CARRIER_COS, CARRIER_SAMPLES, CARRIER_SIN};
use crate::math::frames::AlphaBeta;
use crate::tuning::FirstOrder;

/// Bins of a record.
pub const BINS: usize = 57;
/// Every bin is longer than the one before by this factor.
const GROWTH: f32 = 1.09;
/// The ends of all bins, in lengths of the first: (1.09^57 - 1) / 0.09.
pub(super) const FIRST_BINS: f32 = 1501.0;

/// Kind of record.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Record {
    /// Nothing; what has been collected stays.
    #[default]
    Nothing,
    /// Means in bins that grow by 9 %, in one half of the memory.
    Bins {
        /// The half, 0 or 1.
        half: usize,
        /// Length of the first bin, control periods.
        first: f32,
    },
    /// Products of voltage and current with the carrier.
    Carrier,
    /// Means and squares of the phase currents and of the dc link.
    Noise,
    /// Fit of the plant of the current loop.
    Plant {
        /// Whether across phase a, or along it.
        across: bool,
        /// Amplitude of the voltage, V, and of the current that a sample of it makes, A: the bases of the fit.
        bases: (f32, f32),
    },
    /// Torque current and speed, by [`push_motion`](Collector::push_motion).
    Motion,
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

/// Amplitudes at the carrier, as cosine and sine part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Phasors {
    /// Voltage, V peak.
    pub voltage: [AlphaBeta; 2],
    /// Current, A peak.
    pub current: [AlphaBeta; 2],
}

/// Means of a motor without current.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quiet {
    /// Noise of the sensors a and b, A rms.
    pub noise: [f32; 2],
    /// Dc link, V.
    pub dc_link: f32,
}

/// The sums.
///
/// Call [`begin`](Self::begin) before the command that changes the excitation, and [`push`](Self::push) for every step of
/// the drive while it [excites](crate::Drive::excites). 2 KiB.
#[derive(Clone, Debug)]
pub struct Collector {
    record: Record,
    /// Samples since the record began.
    samples: u32,
    /// Whether samples are missing in the record.
    incomplete: bool,
    /// Bin that is filled, and the sample at which it ends.
    bin: usize,
    end: f32,
    length: f32,
    voltages: [AlphaBeta; 2],
    /// Sums of length, voltage, current of each bin.
    bins: [[Bin; BINS]; 2],
    sums: [f32; 8],
    first_dc_link: f32,
    carrier: usize,
    motion: Motion,
    plant: PlantFit,
}

impl Default for Collector {
    fn default() -> Self {
        Self {
            record: Record::Nothing,
            samples: 0,
            incomplete: false,
            bin: 0,
            end: 0.0,
            length: 0.0,
            voltages: [AlphaBeta::ZERO; 2],
            bins: [[Bin::default(); BINS]; 2],
            sums: [0.0; 8],
            first_dc_link: 0.0,
            carrier: 0,
            motion: Motion::default(),
            plant: PlantFit::default(),
        }
    }
}

impl Collector {
    /// Begins a record.
    pub fn begin(&mut self, record: Record) {
        (self.record, self.samples, self.bin, self.carrier) = (record, 0, 0, 0);
        self.incomplete = false;
        match record {
            Record::Nothing => {}
            Record::Motion => self.motion = Motion::default(),
            Record::Plant { .. } => self.plant = PlantFit::default(),
            Record::Bins { half, first } => {
                (self.end, self.length) = (first, first);
                if let Some(bins) = self.bins.get_mut(half) {
                    *bins = [Bin::default(); BINS];
                }
            }
            Record::Carrier | Record::Noise => self.sums = [0.0; 8],
        }
    }

    /// Samples since the record began.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Notes that steps of the drive are missing between the last and the next: a record that has begun is incomplete.
    pub fn gap(&mut self) {
        self.incomplete |= self.samples > 0 && self.record != Record::Nothing;
    }

    /// Whether samples are missing in the record.
    pub fn is_incomplete(&self) -> bool {
        self.incomplete
    }

    /// Takes a step of the drive while it regulates torque: reference of the torque current, A, and `rotor_freq` of its
    /// [telemetry](crate::Telemetry).
    pub fn push_motion(&mut self, i_q: f32, rotor_freq: f32) {
        if self.record == Record::Motion {
            self.motion.push(i_q, rotor_freq);
            self.samples = self.samples.wrapping_add(1);
        }
    }

    /// The plant that was fitted, in the bases of its record; `None` without one.
    pub(super) fn plant(&self) -> Option<FirstOrder> {
        self.plant.found()
    }

    pub(super) fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Takes a step of the drive while it excites: `measured`, `realised` and `dc_link` of its [telemetry](crate::Telemetry).
    pub fn push(&mut self, measured: AlphaBeta, realised: AlphaBeta, dc_link: f32) {
        if self.record == Record::Motion {
            return;
        }
        let [last, before] = self.voltages;
        self.voltages = [realised, last];
        match self.record {
            Record::Nothing | Record::Motion => {}
            Record::Bins { half, .. } => {
                // The last bin lasts until the next record.
                while self.samples as f32 >= self.end && self.bin + 1 < BINS {
                    self.bin += 1;
                    self.length *= GROWTH;
                    self.end += self.length;
                }
                let voltage = 0.5 * (last.alpha + before.alpha);
                if let Some(bin) = self.bins.get_mut(half).and_then(|bins| bins.get_mut(self.bin)) {
                    bin.periods += 1.0;
                    bin.voltage += voltage;
                    bin.current += measured;
                }
            }
            Record::Plant { across, bases } => {
                let axis = |x: AlphaBeta| if across { x.beta } else { x.alpha };
                self.plant.push(axis(realised) / bases.0, axis(measured) / bases.1);
            }
            Record::Carrier => {
                let table = (CARRIER_COS.get(self.carrier), CARRIER_SIN.get(self.carrier));
                if let (Some(cos), Some(sin)) = table {
                    let (v, i) = (realised, measured);
                    let factors = [v.alpha, v.beta, i.alpha, i.beta];
                    for (pair, x) in self.sums.chunks_exact_mut(2).zip(factors) {
                        if let [re, im] = pair {
                            *re += cos * x;
                            *im += sin * x;
                        }
                    }
                }
                self.carrier =
                    if self.carrier + 1 < CARRIER_SAMPLES { self.carrier + 1 } else { 0 };
            }
            Record::Noise => {
                if self.samples == 0 {
                    self.first_dc_link = dc_link;
                }
                let abc = measured.to_abc();
                let terms =
                    [abc.a, abc.b, abc.a * abc.a, abc.b * abc.b, dc_link - self.first_dc_link];
                for (sum, term) in self.sums.iter_mut().zip(terms) {
                    *sum += term;
                }
            }
        }
        self.samples = self.samples.wrapping_add(1);
    }

    /// The bins of a half that have samples, in their order.
    pub fn bins(&self, half: usize) -> impl Iterator<Item = Bin> + Clone + '_ {
        let filled = self.bins.get(half).into_iter().flatten().filter(|bin| bin.periods > 0.0);
        filled.map(|sum| {
            let share = 1.0 / sum.periods;
            let (voltage, current) = (sum.voltage * share, sum.current * share);
            Bin { periods: sum.periods, voltage, current }
        })
    }

    /// Mean over the bins of a half from the given one on.
    pub(super) fn mean(&self, half: usize, from: usize) -> Bin {
        let mut sum = Bin::default();
        for bin in self.bins(half).skip(from) {
            sum.periods += bin.periods;
            sum.voltage += bin.voltage * bin.periods;
            sum.current += bin.current * bin.periods;
        }
        let share = 1.0 / sum.periods;
        Bin { voltage: sum.voltage * share, current: sum.current * share, ..sum }
    }

    /// Current along phase a at the beginning of the first half, A, where the second has ended.
    pub(super) fn first_steady(&self) -> f32 {
        self.mean(1, BINS - 3).current.alpha
    }

    /// The amplitudes at the carrier.
    pub(super) fn phasors(&self) -> Phasors {
        let share = 2.0 / self.samples as f32;
        let [va, va_s, vb, vb_s, ia, ia_s, ib, ib_s] = self.sums.map(|sum| share * sum);
        Phasors {
            voltage: [AlphaBeta::new(va, vb), AlphaBeta::new(va_s, vb_s)],
            current: [AlphaBeta::new(ia, ib), AlphaBeta::new(ia_s, ib_s)],
        }
    }

    /// Noise and dc link.
    pub(super) fn quiet(&self) -> Quiet {
        let share = 1.0 / self.samples as f32;
        let [a, b, aa, bb, dc_link, ..] = self.sums.map(|sum| share * sum);
        let rms = |square: f32, mean: f32| fpu_sqrt::sqrtf(square - mean * mean);
        Quiet { noise: [rms(aa, a), rms(bb, b)], dc_link: self.first_dc_link + dc_link }
    }
}
