//! The gates of the six switches over a PWM period, after the drivers.

use drive_core::Compare;
use induction_drive::board::PWM_TOP;
use thiserror::Error;

use super::PowerStage;
use stm32g4_unicorn::periph::tim1::{Tim1, Wave};
use stm32g4_unicorn::{chip::TICKS_PER_S, periph::gpio::Gpio};

/// Names of the switches of a leg.
const SIDES: [&str; 2] = ["high", "low"];
const LEGS: [&str; 3] = ["a", "b", "c"];

/// A violation at the gates.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum BadGates {
    /// A switch is on, or may be on, while the timer's outputs are off.
    #[error("{} side {} {} on while the outputs are off", SIDES[*side], LEGS[*leg], if *undefined { "may be" } else { "is" })]
    OnWhileOff {
        /// Leg, 0 is a.
        leg: usize,
        /// Switch, 0 is the high side.
        side: usize,
        /// The level at the driver's input is not defined.
        undefined: bool,
    },
    /// The level at a driver's input is not defined while the outputs are on.
    #[error("the input of {} side {} has no defined level", SIDES[*side], LEGS[*leg])]
    Undefined {
        /// Leg, 0 is a.
        leg: usize,
        /// Switch, 0 is the high side.
        side: usize,
    },
    /// Both switches of this leg, 0 is a, are on together.
    #[error("both switches of leg {} are on", LEGS[*_0])]
    Together(usize),
    /// Both inputs of this leg, 0 is a, request on; the driver's interlock keeps both switches off.
    #[error("both inputs of leg {} request on, and the driver blocks", LEGS[*_0])]
    Interlocked(usize),
    /// The switches of a leg follow each other too soon.
    #[error("leg {} has a dead time of {:.2} us", LEGS[*leg], us(*dead_time))]
    Short {
        /// Leg, 0 is a.
        leg: usize,
        /// Time for which both switches are off, ticks.
        dead_time: u32,
    },
    /// A pin that the board ties to nets of other signals is not analog.
    #[error("P{}{pin} is not analog", char::from(b'A' + *port as u8))]
    NotAnalog {
        /// Its port, 0 is A.
        port: usize,
        /// Its number.
        pin: u32,
    },
    /// A switch of a leg is on for too short a time.
    #[error("leg {} has a pulse of {:.2} us", LEGS[*leg], us(*ticks))]
    Pulse {
        /// Leg, 0 is a.
        leg: usize,
        /// Duration of the pulse, ticks.
        ticks: u32,
    },
}

fn us(ticks: u32) -> f64 {
    f64::from(ticks) * 1e6 / TICKS_PER_S as f64
}

/// A time in which neither switch of a leg changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Its beginning after the top of the counter, ticks.
    pub from: u32,
    /// Its duration, ticks.
    pub ticks: u32,
    /// The switches that are on: high side, low side.
    pub on: [bool; 2],
}

/// The gates of a leg.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Leg {
    /// The pieces of a period, in order.
    pub pieces: Vec<Piece>,
    /// Inputs whose level is not defined: high side, low side.
    undefined: [bool; 2],
    /// Whether the interlock is active.
    interlocked: bool,
    /// The compare value of a leg whose switches alternate; none if they do not.
    compare: Option<u16>,
}

/// The gates of all legs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bridge {
    /// The legs a, b, c.
    pub legs: [Leg; 3],
    /// Whether the timer's outputs are on.
    pub outputs_on: bool,
    /// Time for which both switches of a leg are off at a change, ticks.
    pub dead_time: u32,
}

impl Bridge {
    /// Computes the gates of a power stage from the pins.
    pub fn new(stage: &PowerStage, gpio: &[Gpio], tim1: &Tim1) -> Self {
        let own = ticks(stage.driver.dead_time_s);
        Self {
            legs: [0, 1, 2].map(|leg| Leg::new(stage, own, leg, gpio, tim1)),
            outputs_on: tim1.outputs_on(),
            dead_time: own.max(tim1.dead_time()),
        }
    }

    /// Returns the compare values in force at the motor. The motor has no model for a bridge of which only some legs
    /// are driven: while one leg's switches do not alternate, all legs are off.
    pub fn compare(&self) -> Compare {
        match [0, 1, 2].map(|leg| self.legs[leg].compare) {
            [Some(a), Some(b), Some(c)] => Compare { a, b, c, enabled: true },
            _ => Compare::OFF,
        }
    }

    /// Whether any switch is on at any time, or may be on.
    pub fn any_on(&self) -> bool {
        self.legs.iter().any(|leg| leg.undefined != [false; 2] || leg.is_on(0) || leg.is_on(1))
    }

    /// Checks for switches that are on while they must be off. The lengths of pulses are not checked.
    ///
    /// # Errors
    /// The first violation.
    pub fn check(&self, stage: &PowerStage) -> Result<(), BadGates> {
        let shortest = ticks(stage.limits.dead_time_s);
        self.legs
            .iter()
            .enumerate()
            .try_for_each(|(n, leg)| leg.check(n, self.outputs_on, shortest))
    }

    /// Checks the lengths of the pulses.
    ///
    /// # Errors
    /// The first pulse that is too short.
    pub fn check_pulses(&self, stage: &PowerStage) -> Result<(), BadGates> {
        let shortest = ticks(stage.limits.pulse_s);
        for (leg, gates) in self.legs.iter().enumerate() {
            let too_short =
                |side| gates.times(side).map(|(_, ticks)| ticks).find(|t| *t < shortest);
            if let Some(ticks) = too_short(0).or_else(|| too_short(1)) {
                return Err(BadGates::Pulse { leg, ticks });
            }
        }
        Ok(())
    }
}

fn ticks(seconds: f64) -> u32 {
    (seconds * TICKS_PER_S as f64).round() as u32
}

impl Leg {
    fn new(stage: &PowerStage, own: u32, leg: usize, gpio: &[Gpio], tim1: &Tim1) -> Self {
        let period = tim1.period();
        let (driver, pins) = (&stage.driver, stage.wiring.gates[leg]);
        let requests = driver.requests(pins, leg, gpio, tim1, true);
        let undefined = requests.map(|request| request.is_none());
        // In the worst case a switch whose level is not defined is on.
        let [high, low] =
            requests.map(|request| request.unwrap_or_else(|| Wave::constant(period, true)));
        let (pieces, interlocked) = pieces(high, low, driver.interlock);
        let ideal = driver.requests(pins, leg, gpio, tim1, false);
        let compare = match ideal {
            [Some(high), Some(low)] if low == high.inverted() => {
                // As a share of the plant's top, independent of the timer's.
                Some((high.high() * u32::from(PWM_TOP) / period) as u16)
            }
            _ => None,
        };
        Self { pieces: with_dead_time(pieces, own), undefined, interlocked, compare }
    }

    fn is_on(&self, side: usize) -> bool {
        self.pieces.iter().any(|piece| piece.on[side])
    }

    /// Returns the times at which a switch goes on, and the durations, ticks; none for a switch that does not change.
    fn times(&self, side: usize) -> impl Iterator<Item = (u32, u32)> {
        let count = self.pieces.len();
        let is_on = move |n: usize| self.pieces[n % count].on[side];
        let begins = (0..count).filter(move |n| is_on(*n) && !is_on(n + count - 1));
        begins.map(move |n| {
            let pieces = (n..n + count).take_while(|n| is_on(*n));
            (self.pieces[n].from, pieces.map(|n| self.pieces[n % count].ticks).sum())
        })
    }

    /// Returns the ticks from the end of the other switch's last pulse to each beginning of this switch's pulses.
    fn gaps(&self, side: usize) -> impl Iterator<Item = u32> {
        let period: u32 = self.pieces.iter().map(|piece| piece.ticks).sum();
        let gap = move |begin: u32| {
            let ends = self.times(1 - side).map(|(from, ticks)| from + ticks);
            ends.map(|end| (begin + 2 * period - end) % period).min()
        };
        self.times(side).filter_map(move |(begin, _)| gap(begin))
    }

    fn check(&self, leg: usize, outputs_on: bool, shortest: u32) -> Result<(), BadGates> {
        for side in [0, 1] {
            let undefined = self.undefined[side];
            if !outputs_on && (undefined || self.is_on(side)) {
                return Err(BadGates::OnWhileOff { leg, side, undefined });
            }
            if undefined {
                return Err(BadGates::Undefined { leg, side });
            }
        }
        if self.pieces.iter().any(|piece| piece.on == [true; 2]) {
            return Err(BadGates::Together(leg));
        }
        if self.interlocked {
            return Err(BadGates::Interlocked(leg));
        }
        match self.gaps(0).chain(self.gaps(1)).min() {
            Some(dead_time) if dead_time < shortest => Err(BadGates::Short { leg, dead_time }),
            _ => Ok(()),
        }
    }
}

/// Returns the pieces of a period, and whether the interlock is active.
fn pieces(high: Wave, low: Wave, interlock: bool) -> (Vec<Piece>, bool) {
    let mut instants: Vec<u32> = high.edges().chain(low.edges()).chain([0]).collect();
    instants.sort_unstable();
    instants.dedup();
    let ends = instants.iter().skip(1).chain([&high.period]);
    let mut interlocked = false;
    let pieces = instants.iter().zip(ends).map(|(&from, &end)| {
        let mut on = [high.at(from), low.at(from)];
        if interlock && on == [true; 2] {
            interlocked = true;
            on = [false; 2];
        }
        Piece { from, ticks: end - from, on }
    });
    (pieces.collect(), interlocked)
}

/// Adds the driver's own dead time if the inputs leave less.
fn with_dead_time(mut pieces: Vec<Piece>, own: u32) -> Vec<Piece> {
    if own == 0 {
        return pieces;
    }
    for side in [0, 1] {
        // Ticks at the end of the period since the other switch was last on.
        let last = pieces.iter().rposition(|piece| piece.on[1 - side]);
        let mut since = last.map_or(own, |n| pieces[n + 1..].iter().map(|piece| piece.ticks).sum());
        let mut made = Vec::with_capacity(pieces.len() + 2);
        for piece in pieces {
            let (on, other) = (piece.on[side], piece.on[1 - side]);
            let wait = if on && !other { own.saturating_sub(since).min(piece.ticks) } else { 0 };
            let off = Piece { ticks: wait, on: [false; 2], ..piece };
            let rest = Piece { from: piece.from + wait, ticks: piece.ticks - wait, ..piece };
            made.extend([off, rest].into_iter().filter(|piece| piece.ticks > 0));
            since = if other { 0 } else { since + piece.ticks };
        }
        pieces = made;
    }
    pieces
}
