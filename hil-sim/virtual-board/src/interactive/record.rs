//! Curves of a session of any length: means over some control periods, or over more periods if there are too many.

use std::f64::consts::TAU;

use drive_core::{Telemetry, carrier::CARRIER_SAMPLES};
use hil_sim::outcome::Series;
use hil_sim::plant::{Complex, Plant};
use hil_sim::rig::{RATE_HZ, wrapped_degrees};
use hil_sim::stats::Stats;

use crate::board::Period;

/// A curve of the page: the axis of its panel, its name there, its style, whether the drive reports it (then it does
/// not change while the outputs are off), and its value in a control interrupt.
pub type Curve = (&'static str, &'static str, Drawn, bool, fn(&Plant, &Telemetry) -> f64);
type Drawn = fn(&'static str, Vec<(f64, f64)>) -> Series;

/// Rpm of a radian per second.
const RPM: f64 = 60.0 / TAU;

/// All curves; those of a panel follow each other.
#[rustfmt::skip]
pub const CURVES: [Curve; 8] = [
    ("quadrature current (A)", "measured", Series::line, true, |_, drive| drive.current.q.into()),
    // The reference after its filter.
    ("quadrature current (A)", "reference", Series::reference, true, |_, drive| drive.reference.q.into()),
    ("torque (Nm)", "", Series::line, false, |plant, _| plant.torque()),
    ("rotor flux (Wb)", "", Series::line, false, |plant, _| plant.rotor_flux().norm()),
    ("speed (rpm)", "rotor", Series::line, false, |plant, _| plant.mechanical_speed() * RPM),
    ("speed (rpm)", "estimated", Series::line, true, |plant, drive| {
        f64::from(drive.rotor_freq) * (RATE_HZ * 60.0 / plant.pole_pairs())
    }),
    ("dc link (V)", "inverter", Series::line, false, |plant, _| plant.dc_link()),
    ("dc link (V)", "as measured", Series::reference, true, |_, drive| drive.dc_link.into()),
];

/// Means over some control periods.
#[derive(Clone, Copy, Debug, Default)]
struct Bucket {
    periods: f64,
    time: f64,
    /// Number of these periods with the outputs on.
    on: f64,
    sums: [f64; CURVES.len()],
    /// Sum of unit vectors at the angle errors, because a mean of angles is not defined otherwise.
    error: Complex,
}

impl Bucket {
    fn add(&mut self, other: &Self) {
        self.periods += other.periods;
        self.time += other.time;
        self.on += other.on;
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, more)| *sum += more);
        self.error += other.error;
    }
}

/// Largest number of buckets: more than a plot has pixels, and few enough for a page and for a long session.
const BUCKETS: usize = 30_000;
/// Flux below which its angle is uncertain, Wb: less than half of the drive's flux.
const FLUX_WB: f64 = 0.05;

/// The record of a session.
#[derive(Clone, Debug, Default)]
pub struct Record {
    buckets: Vec<Bucket>,
    open: Bucket,
    /// Number of doublings of a bucket. At first it is an injection period, because the ripple of the injection would
    /// hide everything else.
    doubled: u32,
    /// Number of control interrupts.
    pub interrupts: u64,
    /// Angle error, electrical degrees, where it is judged: with outputs on, and with a flux.
    pub error: Stats,
    /// Largest phase current at a sample, A.
    pub peak_current: f64,
    /// Estimated cycles of the longest control interrupt.
    pub worst_cycles: u32,
}

impl Record {
    /// Adds a control interrupt: the plant at its sample, and the telemetry of the drive after it.
    pub fn take(&mut self, time: f64, plant: &Plant, period: &Period, drive: &Telemetry) {
        let on = period.compare.enabled;
        let counted = f64::from(u8::from(on));
        let mut bucket = Bucket { periods: 1.0, time, on: counted, ..Bucket::default() };
        for ((.., estimated, value), sum) in CURVES.iter().zip(&mut bucket.sums) {
            *sum = if on || !estimated { value(plant, drive) } else { 0.0 };
        }
        self.interrupts += 1;
        self.worst_cycles = self.worst_cycles.max(period.cycles);
        let currents = plant.phase_currents();
        self.peak_current = currents.into_iter().fold(self.peak_current, |m, i| m.max(i.abs()));
        if on && plant.rotor_flux().norm() > FLUX_WB {
            let error = plant.rotor_flux_angle() - f64::from(drive.phi.to_turns()) * TAU;
            bucket.error = Complex::cis(error);
            self.error.push(wrapped_degrees(error));
        }
        self.open.add(&bucket);
        if self.open.periods >= (CARRIER_SAMPLES << self.doubled) as f64 {
            self.buckets.push(std::mem::take(&mut self.open));
        }
        if self.buckets.len() >= BUCKETS {
            self.doubled += 1;
            let pairs = self.buckets.chunks(2).map(|pair| {
                let mut both = pair[0];
                pair[1..].iter().for_each(|other| both.add(other));
                both
            });
            self.buckets = pairs.collect();
        }
    }

    /// Returns points over time, s, of the curve with this index in [`CURVES`]. If the drive reports it, the values are
    /// not numbers while the outputs are off.
    pub fn curve(&self, place: usize) -> Vec<(f64, f64)> {
        self.points(|bucket| {
            bucket.sums[place] / if CURVES[place].3 { bucket.on } else { bucket.periods }
        })
    }

    /// Returns whether the outputs are on, 0 to 1, over time, s.
    pub fn outputs(&self) -> Vec<(f64, f64)> {
        self.points(|bucket| bucket.on / bucket.periods)
    }

    /// Returns the true minus the estimated rotor-flux angle over time, electrical degrees; where it is not judged, the
    /// value is not a number.
    pub fn error_deg(&self) -> Vec<(f64, f64)> {
        let angle = |error: Complex| if error.norm() > 0.0 { error.arg() } else { f64::NAN };
        self.points(|bucket| angle(bucket.error).to_degrees())
    }

    fn points(&self, of: impl Fn(&Bucket) -> f64) -> Vec<(f64, f64)> {
        self.buckets.iter().map(|bucket| (bucket.time / bucket.periods, of(bucket))).collect()
    }
}
