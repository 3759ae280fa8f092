//! Limits of the torque current by the voltage of the dc link, brake chopper, and braking by flux: once a carrier period.
//!
//! A rectifier lets no energy back into the mains, so torque that generates charges the capacitor; torque that motors
//! discharges it when the mains fail. With `v` the measured link, half of it new at each step, `w` the speed, `I` the
//! largest torque current and `r = max(1, |w|/w_power)`:
//!
//! ```text
//! generating <= I clamp((high - v)/(r (high - from)))
//! motoring   <= I clamp((v - held)/(r rise))             held: `low`, gives way towards `floor` while this limits
//! motoring   <= -I clamp((held - v)/(r depth))           ride-through: the shaft feeds the link
//! chopper     = clamp((v - on)/(full - on)) clamp(10 (1 - heat))
//! ```
//!
//! Power is torque times speed, so `r` keeps the gain of these loops what it is at `w_power`, 60 Hz electrical (with
//! generating torque, up to 1.4 times that speed). Near standstill the copper losses take all that the shaft gives: below
//! 9 Hz nothing is limited. With a resistor that can still take energy, generating torque is limited above the middle of
//! the chopper's band alone. Above 40 Hz a limited generating torque asks for more flux, whose current burns power; below,
//! the flux must be back when the carrier comes on.
//!
//! A sagging mains and one that is gone look alike at first: motoring torque is taken away. Without load the link of a
//! sagging mains stays where it is, and `held` gives way below it, so that the torque comes back; in an outage the shaft
//! holds the link at `held`.

use core::fmt;

use crate::PERIOD_S;

/// Control periods per step: those of a carrier period.
pub const DIVIDER: u8 = 10;
/// Seconds per step.
const STEP_S: f32 = DIVIDER as f32 * PERIOD_S;

/// Band of the voltage in which motoring torque comes, in relation to how far the held voltage gives way: a mains that sags
/// to `floor + 11 V` carries all torque up to twice `w_power`.
const RISE: f32 = 1.0 / 9.0;
/// The same in relation to the band in which the shaft feeds the link. That loop has no mains that damps it.
const RISE_OF_DEPTH: f32 = 1.0 / 6.0;
/// Most that the band of generating torque is widened: it stays clear of the nominal voltage.
const WIDEST: f32 = 1.4;
/// Time in which the held voltage gives way to the floor, s.
const YIELD_S: f32 = 0.45;
/// Electrical speeds, turns per control period: where the limits begin, over which band they come on, from which on flux
/// brakes, and from which on gains go down with the speed. 270, 68, 1200 and 1800 rpm of four poles.
const SLOW: f32 = 9.0 * PERIOD_S;
const FADES: f32 = 0.25 * SLOW;
const FLUX: f32 = 40.0 * PERIOD_S;
const POWER: f32 = 60.0 * PERIOD_S;
/// Braking by flux begins where this share of the generating torque is left, and is whole where half of it is.
const FLUX_FROM: f32 = 0.75;
const FLUX_GAIN: f32 = 4.0;
/// The duty goes down over the last tenth of the energy that the resistor takes.
const COOL_GAIN: f32 = 10.0;

/// A brake resistor behind a chopper. `under_v` and `over_v` are the voltages at which the drive trips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChopperSettings {
    /// Voltage at which it begins to conduct, V; half of `full_v` to 0.999 times it.
    pub on_v: f32,
    /// Voltage from which on it conducts throughout, V; `from_v` to `over_v`.
    pub full_v: f32,
    /// Resistance, ohm; 0.1 to 1e5.
    pub resistance: f32,
    /// Energy that it takes from cold, J; 1 to 1e7.
    pub energy_j: f32,
    /// Power that it takes for ever, W; 0.1 to 1e5.
    pub power_w: f32,
}

/// Settings of the limits, with their ranges, within which [`DcLink::new`] expects them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcLinkSettings {
    /// Voltage from which on generating torque is limited, V; half of `high_v` to 0.99 times it.
    pub from_v: f32,
    /// Voltage without generating torque, V; `under_v` to `over_v`.
    pub high_v: f32,
    /// Voltage without motoring torque, V, below which the shaft feeds the link; `under_v` to `from_v`.
    pub low_v: f32,
    /// Voltage down to which the latter gives way when the link stays low, V; `under_v` to 0.99 of `low_v`.
    pub floor_v: f32,
    /// Direct current that is added while generating torque is limited, A; 0 for none.
    pub flux_a: f32,
    /// The brake resistor, if there is one.
    pub chopper: Option<ChopperSettings>,
}

/// Why torque is limited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Limiting {
    /// It is not.
    #[default]
    None,
    /// The dc link has no more voltage at this speed; see `voltage_limit`.
    Voltage,
    /// The heat sink is hot.
    HeatSink,
    /// The motor carries no more for any time.
    Motor,
    /// The inverter carries no more for any time.
    Inverter,
    /// Generating torque: the link is high.
    DcLinkHigh,
    /// Generating torque: the link is high, and the brake resistor has taken all that it can.
    ResistorHot,
    /// Motoring torque: the link is low.
    DcLinkLow,
    /// The shaft feeds the link, which has no supply.
    RideThrough,
    /// Dc current or power is at its limit.
    Power,
}

/// Reason of the limit, in words.
impl fmt::Display for Limiting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "nothing",
            Self::Voltage => "the voltage of the dc link at this speed",
            Self::HeatSink => "the heat sink is hot",
            Self::Motor => "the motor is at its thermal limit",
            Self::Inverter => "the inverter is at its thermal limit",
            Self::DcLinkHigh => "the dc link is high",
            Self::ResistorHot => "the dc link is high and the brake resistor hot",
            Self::DcLinkLow => "the dc link is low",
            Self::RideThrough => "the dc link has no supply: the shaft feeds it",
            Self::Power => "dc current or power is at its limit",
        })
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DcLinkLimits {
    /// Least and largest torque current, A. Both have one sign while the shaft feeds the link.
    pub i_q: (f32, f32),
    /// Why the torque current is not less and not more than this.
    pub why: (Limiting, Limiting),
    /// Direct current to be added, A.
    pub flux_a: f32,
    /// Duty of the chopper, 0 to 1.
    pub chopper: f32,
}

impl DcLinkLimits {
    /// The torque current, A, within the limits, and why it was changed.
    pub fn clamp(&self, i_q: f32) -> (f32, Limiting) {
        if i_q < self.i_q.0 {
            (self.i_q.0, self.why.0)
        } else if i_q > self.i_q.1 {
            (self.i_q.1, self.why.1)
        } else {
            (i_q, Limiting::None)
        }
    }
}

/// Coefficients of the chopper.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Chopper {
    on: f32,
    per_band: f32,
    /// Band of the voltage in which generating torque is limited while the resistor takes energy.
    band: (f32, f32),
    /// Heat per step and squared volt at full duty; 1 is all that the resistor can take.
    per_square: f32,
    /// Share of the heat that goes in a step.
    cooling: f32,
}

/// Coefficients of the limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcLink {
    /// Band of the voltage in which generating torque is limited.
    band: (f32, f32),
    low: f32,
    /// Largest value of [`DcLinkState::lowered`], V.
    lowered_max: f32,
    /// Change of the held voltage in a step, V.
    lowering: f32,
    per_rise: f32,
    flux_a: f32,
    chopper: Option<Chopper>,
}

/// State of the limits. It is kept over stops and starts: the resistor stays hot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DcLinkState {
    /// Smoothed voltage, V; none before the first step.
    v: Option<f32>,
    /// By how much the held voltage is lowered, V.
    lowered: f32,
    /// Heat of the brake resistor; 1 is all that it can take.
    pub heat: f32,
}

impl DcLink {
    /// Limits with these settings, which are within the ranges that [`DcLinkSettings`] states.
    pub fn new(s: &DcLinkSettings) -> Self {
        Self {
            band: (s.from_v, s.high_v),
            low: s.low_v,
            lowered_max: s.low_v - s.floor_v,
            lowering: (s.low_v - s.floor_v) * (STEP_S / YIELD_S),
            per_rise: 1.0 / ((s.low_v - s.floor_v) * RISE),
            flux_a: s.flux_a,
            chopper: s.chopper.map(|c| {
                let half = 0.5 * (c.full_v - c.on_v);
                Chopper {
                    on: c.on_v,
                    per_band: 0.5 / half,
                    band: (c.on_v + half, c.full_v + half),
                    per_square: STEP_S / (c.resistance * c.energy_j),
                    cooling: STEP_S * c.power_w / c.energy_j,
                }
            }),
        }
    }

    /// Whether there is a brake resistor.
    pub const fn has_chopper(&self) -> bool {
        self.chopper.is_some()
    }

    /// One step with the measured dc link `dc_link`, V, at the speed `freq` of the rotor, electrical turns per control
    /// period, for torque currents within `i_q_limit`, A, which is less than the usual for this reason.
    pub fn step(
        &self,
        state: &mut DcLinkState,
        dc_link: f32,
        freq: f32,
        (i_q_limit, reason): (f32, Limiting),
    ) -> DcLinkLimits {
        let before = state.v.unwrap_or(dc_link);
        let v = before + 0.5 * (dc_link - before);
        state.v = Some(v);
        let speed = freq.abs();
        let gain = if speed > POWER { POWER / speed } else { 1.0 };
        let down = if gain < 1.0 / WIDEST { 1.0 / WIDEST } else { gain };
        let weight = ((speed - SLOW) * (1.0 / FADES)).clamp(0.0, 1.0);

        let (chopper, cold) = self.brake(state, v);
        let with = self.chopper.map_or(self.band, |c| c.band);
        let (from, high) = (
            self.band.0 + cold * (with.0 - self.band.0),
            self.band.1 + cold * (with.1 - self.band.1),
        );
        let generating = (down * (high - v) / (high - from)).clamp(0.0, 1.0);
        let flux = (FLUX_GAIN * (FLUX_FROM - generating)).clamp(0.0, 1.0);
        let flux_a = if speed > FLUX { flux * self.flux_a } else { 0.0 };

        // 1 at the upper end of the band of motoring torque.
        let above = gain * (v - self.low + state.lowered) * self.per_rise;
        self.adapt_held_voltage(state, above);
        let slope = if above < 0.0 { RISE_OF_DEPTH } else { 1.0 };
        let motoring = (slope * above).clamp(-1.0, 1.0);

        let limit = |share: f32| (1.0 - weight + weight * share) * i_q_limit;
        let (motoring, generating) = (limit(motoring), limit(generating));
        let high = if generating >= i_q_limit {
            reason
        } else if self.chopper.is_some() && cold < 1.0 {
            Limiting::ResistorHot
        } else {
            Limiting::DcLinkHigh
        };
        let low = if motoring >= i_q_limit {
            reason
        } else if motoring < 0.0 {
            Limiting::RideThrough
        } else {
            Limiting::DcLinkLow
        };
        let (i_q, why) = if freq < 0.0 {
            ((-motoring, generating), (low, high))
        } else {
            ((-generating, motoring), (high, low))
        };
        DcLinkLimits { i_q, why, flux_a, chopper }
    }

    /// Cools the resistor for so many control periods without torque.
    pub fn rest(&self, state: &mut DcLinkState, periods: u32) {
        if let Some(c) = &self.chopper {
            state.heat -= c.cooling * (periods as f32 / f32::from(DIVIDER)) * state.heat;
        }
    }

    /// Duty of the chopper, and how much of it the heat of the resistor leaves.
    fn brake(&self, state: &mut DcLinkState, v: f32) -> (f32, f32) {
        let Some(c) = &self.chopper else { return (0.0, 0.0) };
        let cold = (COOL_GAIN * (1.0 - state.heat)).clamp(0.0, 1.0);
        let duty = cold * ((v - c.on) * c.per_band).clamp(0.0, 1.0);
        state.heat += duty * c.per_square * v * v - c.cooling * state.heat;
        (duty, cold)
    }

    /// Lowers the held voltage while motoring torque is limited, and raises it again with room to spare; `above` is
    /// how far up its band the link is.
    fn adapt_held_voltage(&self, state: &mut DcLinkState, above: f32) {
        if above < 1.0 {
            state.lowered += self.lowering;
        } else if above > 2.0 {
            state.lowered -= self.lowering;
        }
        state.lowered = state.lowered.max(0.0).min(self.lowered_max);
    }
}

#[cfg(test)]
mod tests;
