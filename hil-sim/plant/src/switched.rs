//! The inverter with its switching edges: the state of each leg at every instant of a PWM period.
//!
//! The counter starts at its top, and a leg is commanded high while the counter is below the compare value of the leg.
//! A pulse of width `T c/top` therefore lies in the middle of the period. An edge takes effect after the propagation
//! delay. From then on both switches of the leg are off for the dead time, and the diodes hold the leg at the rail from
//! which its current flows. The direction of the current is taken at the start of the integration step; without current
//! the leg is at half the dc link. A pulse shorter than the dead time vanishes, as it does in the timer.

use drive_core::Compare;
use heapless::Vec;

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

/// Commanded edges of one leg, in order of time: the instant at which the edge takes effect (s from the start of the
/// period), and whether the leg goes high.
#[derive(Clone, Debug)]
struct Leg(Vec<(f64, bool), EDGES>);

impl Leg {
    fn new(before: f64, now: f64, period: f64, delay: f64) -> Self {
        let boundary = ((before >= 1.0) != (now >= 1.0)).then_some((0.0, now >= 1.0));
        let edges = Self::pulse(before, -period, period).chain(boundary);
        let edges = edges.chain(Self::pulse(now, 0.0, period));
        let mut edges: Vec<_, EDGES> = edges.map(|(time, high)| (time + delay, high)).collect();
        if edges.is_empty() {
            // An edge in the distant past.
            edges.extend([(f64::NEG_INFINITY, now >= 1.0)]);
        }
        Self(edges)
    }

    fn pulse(duty: f64, start: f64, period: f64) -> impl Iterator<Item = (f64, bool)> {
        let edge = |share: f64| start + 0.5 * period * share;
        let edges = [(edge(1.0 - duty), true), (edge(1.0 + duty), false)];
        edges.into_iter().filter(move |_| duty > 0.0 && duty < 1.0)
    }

    /// Returns the level at `time`.
    #[inline]
    fn level(&self, time: f64, dead_time: f64) -> Level {
        let Some(&(edge, high)) = self.0.iter().rev().find(|(edge, _)| *edge <= time) else {
            // The time is before the first edge.
            return if self.0[0].1 { Level::Low } else { Level::High };
        };
        match (time - edge < dead_time, high) {
            (true, _) => Level::Off,
            (false, true) => Level::High,
            (false, false) => Level::Low,
        }
    }
}

/// The instants of one period at which a leg changes its level.
#[derive(Clone, Debug)]
pub(crate) struct Pattern {
    legs: [Leg; 3],
    instants: Vec<f64, INSTANTS>,
    dead_time: f64,
}

impl Pattern {
    /// Computes the pattern of a period of `period` seconds with these compare values, outputs on.
    pub(crate) fn new(inverter: &Inverter, compare: &Compare, period: f64) -> Self {
        // If the outputs were off, there are no edges of the previous period, as if it had been all low.
        let before =
            if inverter.previous.enabled { inverter.previous } else { Compare::LOW_SIDES_ON };
        let duty = |c: u16| f64::from(c) / inverter.top;
        let delay = inverter.settings.propagation_us * 1e-6;
        let legs = [(before.a, compare.a), (before.b, compare.b), (before.c, compare.c)]
            .map(|(before, now)| Leg::new(duty(before), duty(now), period, delay));
        let edges = legs.iter().flat_map(|leg| &leg.0);
        let changes = edges.flat_map(|(edge, _)| [*edge, edge + inverter.dead_time]);
        let inside = changes.filter(|instant| *instant > 0.0 && *instant < period);
        let mut instants: Vec<f64, INSTANTS> = inside.chain([period]).collect();
        instants.sort_unstable_by(f64::total_cmp);
        Self { legs, instants, dead_time: inverter.dead_time }
    }

    /// Returns the pieces of the period: duration (s), and the levels of the legs.
    pub(crate) fn pieces(&self) -> impl Iterator<Item = (f64, [Level; 3])> + '_ {
        let mut start = 0.0;
        self.instants.iter().filter_map(move |&end| {
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
            residual: inverter.settings.residual_v,
            on_resistance: inverter.settings.on_resistance,
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
