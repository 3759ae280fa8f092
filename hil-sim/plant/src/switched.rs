//! The inverter with its switching edges: the state of each leg at every instant of a PWM period.
//!
//! The counter starts at its top, and a leg is commanded high while the counter is below the compare value of the leg.
//! A pulse of width `T c/top` therefore lies in the middle of the period. An edge takes effect after the propagation
//! delay. From then on both switches of the leg are off for the dead time, and the diodes hold the leg at the rail from
//! which its current flows. The direction of the current is taken at the start of the integration step; without current
//! the leg is at half the dc link. A pulse shorter than the dead time vanishes, as it does in the timer.

use drive_core::Compare;

use crate::averaged::SmoothSign;
use crate::complex::{Complex, clarke, phases};
use crate::inverter::Inverter;
use crate::terminals::Source;

/// Current below which a leg with both switches off has no defined level, A.
const NO_CURRENT: f64 = 1e-9;
/// Number of edges of one leg that matter in one period: two of this period, two of the previous period, one at the
/// boundary.
const EDGES: usize = 5;
/// Number of times at which anything changes: two per edge and leg, and the end.
const INSTANTS: usize = 3 * 2 * EDGES + 1;

/// State of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Level {
    /// Low side on.
    Low,
    /// High side on.
    High,
    /// Both off.
    Off,
}

/// Commanded edges of one leg, in order of time.
#[derive(Clone, Copy, Debug)]
struct Leg {
    /// Instant at which the edge takes effect (s from the start of the period), and whether the leg goes high.
    edges: [(f64, bool); EDGES],
    count: usize,
}

impl Leg {
    fn new(before: f64, now: f64, period: f64, delay: f64) -> Self {
        let mut leg = Self { edges: [(0.0, false); EDGES], count: 0 };
        leg.pulse(before, -period, period);
        if (before >= 1.0) != (now >= 1.0) {
            leg.push(0.0, now >= 1.0);
        }
        leg.pulse(now, 0.0, period);
        if leg.count == 0 {
            // An edge in the distant past.
            leg.push(f64::NEG_INFINITY, now >= 1.0);
        }
        for (time, _) in &mut leg.edges {
            *time += delay;
        }
        leg
    }

    fn push(&mut self, time: f64, high: bool) {
        self.edges[self.count] = (time, high);
        self.count += 1;
    }

    fn pulse(&mut self, duty: f64, start: f64, period: f64) {
        if duty > 0.0 && duty < 1.0 {
            self.push(start + 0.5 * period * (1.0 - duty), true);
            self.push(start + 0.5 * period * (1.0 + duty), false);
        }
    }

    /// Returns the level at `time`.
    #[inline]
    fn level(&self, time: f64, dead_time: f64) -> Level {
        let edges = &self.edges[..self.count];
        let Some(&(edge, high)) = edges.iter().rev().find(|(edge, _)| *edge <= time) else {
            // The time is before the first edge.
            return if edges[0].1 { Level::Low } else { Level::High };
        };
        match (time - edge < dead_time, high) {
            (true, _) => Level::Off,
            (false, true) => Level::High,
            (false, false) => Level::Low,
        }
    }
}

/// The instants of one period at which a leg changes its level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pattern {
    legs: [Leg; 3],
    instants: [f64; INSTANTS],
    count: usize,
    dead_time: f64,
}

impl Pattern {
    /// Computes the pattern of a period of `period` seconds with these compare values, outputs on.
    pub(crate) fn new(inverter: &Inverter, compare: &Compare, period: f64) -> Self {
        // If the outputs were off, there are no edges of the previous period, as if it had been all low.
        let before =
            if inverter.previous.enabled { inverter.previous } else { Compare::LOW_SIDES_ON };
        let duty = |c: u16| f64::from(c) / inverter.top;
        let legs = [(before.a, compare.a), (before.b, compare.b), (before.c, compare.c)]
            .map(|(before, now)| Leg::new(duty(before), duty(now), period, inverter.propagation));
        let mut instants = [0.0; INSTANTS];
        let mut count = 0;
        for leg in &legs {
            for &(edge, _) in &leg.edges[..leg.count] {
                for instant in [edge, edge + inverter.dead_time] {
                    if instant > 0.0 && instant < period {
                        instants[count] = instant;
                        count += 1;
                    }
                }
            }
        }
        instants[count] = period;
        count += 1;
        instants[..count].sort_unstable_by(f64::total_cmp);
        Self { legs, instants, count, dead_time: inverter.dead_time }
    }

    /// Returns the pieces of the period: duration (s), and the levels of the legs.
    pub(crate) fn pieces(&self) -> impl Iterator<Item = (f64, [Level; 3])> + '_ {
        let mut start = 0.0;
        self.instants[..self.count].iter().filter_map(move |&end| {
            let duration = end - start;
            let middle = 0.5 * (start + end);
            start = end;
            (duration > 0.0).then(|| {
                let levels = self.legs.each_ref().map(|leg| leg.level(middle, self.dead_time));
                (duration, levels)
            })
        })
    }
}

/// Leg voltages at these levels and this stator current.
#[inline]
fn leg_voltages(levels: [Level; 3], i: Complex, vdc: f64) -> [f64; 3] {
    let currents = phases(i);
    std::array::from_fn(|k| match levels[k] {
        Level::Low => 0.0,
        Level::High => vdc,
        Level::Off if currents[k] > NO_CURRENT => 0.0,
        Level::Off if currents[k] < -NO_CURRENT => vdc,
        Level::Off => 0.5 * vdc,
    })
}

/// The legs with the voltage drops of the conducting switches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Legs {
    /// Leg voltages as a space vector, V.
    v: Complex,
    sign: SmoothSign,
    residual: f64,
    on_resistance: f64,
}

impl Legs {
    /// Computes the legs at these levels; the direction of the stator current `i` matters.
    #[inline]
    pub(crate) fn new(inverter: &Inverter, levels: [Level; 3], i: Complex) -> Self {
        Self {
            v: clarke(leg_voltages(levels, i, inverter.vdc)),
            sign: inverter.sign,
            residual: inverter.residual,
            on_resistance: inverter.on_resistance,
        }
    }
}

impl Source for Legs {
    #[inline(always)]
    fn voltage(&self, i: Complex) -> Complex {
        let signs = phases(i).map(|i| self.sign.of(i));
        self.v - i * self.on_resistance - clarke(signs) * self.residual
    }
}
