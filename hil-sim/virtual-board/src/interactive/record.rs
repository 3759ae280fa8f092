//! Curves of a session of any length: means over some control periods, over more when there are too many.

use std::f64::consts::TAU;

use drive_core::{Telemetry, carrier::CARRIER_SAMPLES};
use hil_sim::plant::{Complex, Plant};
use hil_sim::rig::{RATE_HZ, wrapped_degrees};
use hil_sim::stats::Stats;

use crate::board::Period;

/// A quantity that is recorded, in the order of `Means`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Filtered reference on the quadrature axis, A.
    ReferenceQ,
    /// Current on the quadrature axis as the drive sees it, A.
    CurrentQ,
    /// Torque of the motor, Nm.
    Torque,
    /// Length of the rotor flux, Wb.
    Flux,
    /// Speed of the rotor, rpm.
    Speed,
    /// The same as the drive estimates it, rpm.
    SpeedEstimate,
    /// Dc-link voltage as the drive sees it, V.
    DcLinkSeen,
    /// Dc-link voltage, V.
    DcLink,
    /// Whether the outputs are on, 0 or 1.
    Outputs,
}

impl Quantity {
    /// Whether the drive reports it: it stands still while the outputs are off.
    fn is_estimated(self) -> bool {
        matches!(self, Self::ReferenceQ | Self::CurrentQ | Self::SpeedEstimate | Self::DcLinkSeen)
    }
}

type Means = [f64; 9];

/// Means over some control periods.
#[derive(Clone, Copy, Debug, Default)]
struct Bucket {
    periods: f64,
    time: f64,
    sums: Means,
    /// Sum of unit vectors that show the angle error: angles have no mean of their own.
    error: Complex,
}

impl Bucket {
    fn add(&mut self, other: &Self) {
        self.periods += other.periods;
        self.time += other.time;
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, more)| *sum += more);
        self.error += other.error;
    }
}

/// Most buckets: more than a plot has pixels, and few enough for a page and for a long session.
const BUCKETS: usize = 30_000;
/// A flux below this has hardly an angle, Wb: under half of the drive's flux.
const FLUX_WB: f64 = 0.05;

/// The record of a session.
#[derive(Clone, Debug, Default)]
pub struct Record {
    buckets: Vec<Bucket>,
    open: Bucket,
    /// How often a bucket was doubled. It is a period of the carrier at first: its ripple would hide everything else.
    doubled: u32,
    /// Control interrupts.
    pub interrupts: u64,
    /// Angle error, electrical degrees, where it is judged: outputs on, and a flux.
    pub error: Stats,
    /// Largest phase current at a sample, A.
    pub peak_current: f64,
    /// Estimated cycles of the longest control interrupt.
    pub worst_cycles: u32,
}

impl Record {
    /// Takes a control interrupt: the plant at its sample, and the telemetry of the drive after it.
    pub fn take(&mut self, time: f64, plant: &Plant, period: &Period, drive: &Telemetry) {
        let rpm = 60.0 / TAU;
        let turns_to_rpm = RATE_HZ * 60.0 / plant.pole_pairs();
        let on = period.compare.enabled;
        let flux = plant.rotor_flux().norm();
        let mut bucket = Bucket { periods: 1.0, time, ..Bucket::default() };
        for (quantity, value) in [
            (Quantity::ReferenceQ, drive.reference.q.into()),
            (Quantity::CurrentQ, drive.current.q.into()),
            (Quantity::Torque, plant.torque()),
            (Quantity::Flux, flux),
            (Quantity::Speed, plant.mechanical_speed() * rpm),
            (Quantity::SpeedEstimate, f64::from(drive.rotor_freq) * turns_to_rpm),
            (Quantity::DcLinkSeen, drive.dc_link.into()),
            (Quantity::DcLink, plant.dc_link()),
            (Quantity::Outputs, f64::from(u8::from(on))),
        ] {
            let counts = on || !quantity.is_estimated();
            bucket.sums[quantity as usize] = if counts { value } else { 0.0 };
        }
        self.interrupts += 1;
        self.worst_cycles = self.worst_cycles.max(period.cycles);
        let currents = plant.phase_currents();
        self.peak_current = currents.into_iter().fold(self.peak_current, |m, i| m.max(i.abs()));
        if on && flux > FLUX_WB {
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

    /// Curve of a quantity over time, s; quantities that the drive reports are not-a-numbers while the outputs
    /// are off.
    pub fn curve(&self, quantity: Quantity) -> Vec<(f64, f64)> {
        self.points(|bucket| {
            let on = bucket.sums[Quantity::Outputs as usize];
            let counted = if quantity.is_estimated() { on } else { bucket.periods };
            bucket.sums[quantity as usize] / counted
        })
    }

    /// True minus estimated rotor-flux angle over time, electrical degrees; a not-a-number where it is
    /// not judged.
    pub fn error_deg(&self) -> Vec<(f64, f64)> {
        let angle = |error: Complex| if error.norm() > 0.0 { error.arg() } else { f64::NAN };
        self.points(|bucket| angle(bucket.error).to_degrees())
    }

    fn points(&self, of: impl Fn(&Bucket) -> f64) -> Vec<(f64, f64)> {
        self.buckets.iter().map(|bucket| (bucket.time / bucket.periods, of(bucket))).collect()
    }
}
