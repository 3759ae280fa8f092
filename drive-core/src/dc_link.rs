//! Limits of the q-axis current by the voltage of the dc link, brake chopper, and flux braking, computed once an injection period.
//!
//! A rectifier returns no energy to the mains, so generating torque charges the capacitor; motoring torque discharges
//! it when the mains fail. With `v` the voltage of the link (a low-pass that takes half of each new value), `w` the
//! speed, `I` the largest q-axis current and `r = max(1, |w|/w_power)`:
//!
//! ```text
//! generating <= I clamp((high - v)/(r (high - from)))
//! motoring   <= I clamp((v - held)/(r rise))             held: `low`, lowered towards `floor` while this limits
//! motoring   <= -I clamp((held - v)/(r depth))           kinetic buffering: the shaft feeds the link
//! chopper     = clamp((v - on)/(full - on)) clamp(10 (1 - heat))
//! ```
//!
//! Power is torque times speed, so above `w_power`, 60 Hz electrical, `r` keeps the gain of these loops constant (for
//! generating torque, up to 1.4 times that speed). Near standstill the copper losses absorb the whole power of the shaft,
//! so nothing is limited below 9 Hz. If a resistor can still absorb energy, generating torque is limited only above the
//! middle of the chopper's band. Above 40 Hz a limited generating torque adds flux, whose current dissipates power. Below
//! 40 Hz it adds none, because the flux must have its setting when the injection is switched on.
//!
//! A sag of the mains and an outage look alike at first, and motoring torque is removed in both. In a sag, the link
//! stays at its voltage without load and `held` is lowered below it, so that the torque returns. In an outage the shaft
//! holds the link at `held`.

use core::fmt;

use crate::PERIOD_S;

/// Control periods per step, as many as in an injection period.
pub const DIVIDER: u8 = 10;
/// Seconds per step.
const STEP_S: f32 = DIVIDER as f32 * PERIOD_S;

/// Band of the voltage in which motoring torque rises, relative to the range by which the held voltage can be lowered. If
/// the mains sag to `floor + 11 V`, all torque is available up to twice `w_power`.
const RISE: f32 = 1.0 / 9.0;
/// The same band relative to the band of kinetic buffering, whose loop is not damped by the mains.
const RISE_OF_DEPTH: f32 = 1.0 / 6.0;
/// Largest factor by which the band of generating torque is widened, so that it stays above the nominal voltage.
const WIDEST: f32 = 1.4;
/// Time in which the held voltage is lowered to the floor, s.
const YIELD_S: f32 = 0.45;
/// Electrical speeds, turns per control period: the speed at which the limits begin, the band over which they become
/// full, the speed above which flux braking works, and the speed above which gains fall. They are 270, 68, 1200 and 1800
/// rpm for four poles.
const SLOW: f32 = 9.0 * PERIOD_S;
const FADES: f32 = 0.25 * SLOW;
const FLUX: f32 = 40.0 * PERIOD_S;
const POWER: f32 = 60.0 * PERIOD_S;
/// Share of the generating torque that is left when flux braking begins. It is full when half of the generating torque is left.
const FLUX_FROM: f32 = 0.75;
const FLUX_GAIN: f32 = 4.0;
/// Gain with which the duty falls over the last tenth of the energy that the resistor can absorb.
const COOL_GAIN: f32 = 10.0;

/// A brake resistor with its chopper. `under_v` and `over_v` are the voltages at which the drive trips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChopperSettings {
    /// Voltage at which the chopper begins to conduct, V; half of `full_v` to 0.999 times `full_v`.
    pub on_v: f32,
    /// Voltage above which the chopper conducts all the time, V; `from_v` to `over_v`.
    pub full_v: f32,
    /// Resistance, ohm; 0.1 to 1e5.
    pub resistance: f32,
    /// Energy that the cold resistor can absorb, J; 1 to 1e7.
    pub energy_j: f32,
    /// Continuous power of the resistor, W; 0.1 to 1e5.
    pub power_w: f32,
}

/// Settings of the limits. [`DcLink::new`] expects them within the stated ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcLinkSettings {
    /// Voltage above which generating torque is limited, V; half of `high_v` to 0.99 times `high_v`.
    pub from_v: f32,
    /// Braking limit: voltage at which generating torque ends, V; `under_v` to `over_v`.
    pub high_v: f32,
    /// Voltage at which motoring torque ends and below which kinetic buffering begins, V; `under_v` to `from_v`.
    pub low_v: f32,
    /// Voltage to which `low_v` is lowered while the link stays low, V; `under_v` to 0.99 of `low_v`.
    pub floor_v: f32,
    /// D-axis current that is added while generating torque is limited, A; 0 for none.
    pub flux_a: f32,
    /// The brake resistor, if there is one.
    pub chopper: Option<ChopperSettings>,
}

/// Reason why torque is limited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Limiting {
    /// Torque is not limited.
    #[default]
    None,
    /// The dc link has no more voltage at this speed; see `voltage_limit`.
    Voltage,
    /// The heat sink is hot.
    HeatSink,
    /// The motor is at its continuous load.
    Motor,
    /// The inverter is at its continuous load.
    Inverter,
    /// The link is high, so generating torque is limited.
    DcLinkHigh,
    /// The link is high and the brake resistor can absorb no more energy, so generating torque is limited.
    ResistorHot,
    /// The link is low, so motoring torque is limited.
    DcLinkLow,
    /// Kinetic buffering: the link has no supply and the shaft feeds it.
    RideThrough,
    /// Dc current or power is at its limit.
    Power,
}

/// Shows the reason of the limit in words.
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
            Self::RideThrough => "the dc link has no supply: kinetic buffering",
            Self::Power => "dc current or power is at its limit",
        })
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DcLinkLimits {
    /// Least and largest q-axis current, A. Both have the same sign during kinetic buffering.
    pub i_q: (f32, f32),
    /// Reasons of the lower and of the upper limit of the q-axis current.
    pub why: (Limiting, Limiting),
    /// D-axis current to be added, A.
    pub flux_a: f32,
    /// Duty of the chopper, 0 to 1.
    pub chopper: f32,
}

impl DcLinkLimits {
    /// Returns the q-axis current within the limits, A, and the reason if it was changed.
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
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Chopper {
    on: f32,
    per_band: f32,
    /// Band of the voltage in which generating torque is limited while the resistor can absorb energy.
    band: (f32, f32),
    /// Heat per step and squared volt at full duty; 1 is all that the resistor can absorb.
    per_square: f32,
    /// Share of the heat that is dissipated in a step.
    cooling: f32,
}

/// Coefficients of the limits.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
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

/// State of the limits. It is kept over stops and starts, since the resistor stays hot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DcLinkState {
    /// Smoothed voltage, V; none before the first step.
    v: Option<f32>,
    /// Voltage by which the held voltage is lowered, V.
    lowered: f32,
    /// Heat of the brake resistor; 1 is all that it can absorb.
    pub heat: f32,
}

impl DcLink {
    /// Creates the limits with these settings, which must be within the ranges that [`DcLinkSettings`] states.
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

    /// Runs one step with the measured dc link `dc_link`, V, at the rotor speed `freq`, electrical turns per control
    /// period, for q-axis currents within `i_q_limit`, A. `reason` is the reason of that limit.
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

        // This is 1 at the upper end of the band of motoring torque.
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

    /// Returns the duty of the chopper, and the share of it that the heat of the resistor allows.
    fn brake(&self, state: &mut DcLinkState, v: f32) -> (f32, f32) {
        let Some(c) = &self.chopper else { return (0.0, 0.0) };
        let cold = (COOL_GAIN * (1.0 - state.heat)).clamp(0.0, 1.0);
        let duty = cold * ((v - c.on) * c.per_band).clamp(0.0, 1.0);
        state.heat += duty * c.per_square * v * v - c.cooling * state.heat;
        (duty, cold)
    }

    /// Lowers the held voltage while motoring torque is limited, and raises it again when there is a margin;
    /// `above` is the position of the link in the band of motoring torque.
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
