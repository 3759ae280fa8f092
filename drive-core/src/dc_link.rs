//! Limits of the torque current by the voltage of the dc link, brake chopper, and braking by flux: once a carrier period.
//!
//! A rectifier lets no energy back into the mains, so torque that generates charges the capacitor; torque that motors
//! discharges it when the mains fail. With `v` the measured link, half of it new at each step, `w` the speed, `I` the
//! largest torque current and `r = max(1, |w|/w_power)`:
//!
//! ```text
//! generating <= I clamp((high - v)/(r (high - from)))
//! motoring   <= I clamp((v - held)/(r rise))             held: `low`, which gives way towards `floor` while v < low
//! motoring   <= -I clamp((held - v)/(r depth))           ride-through: the shaft feeds the link
//! chopper     = clamp((v - on)/(full - on)) clamp(10 (1 - heat))
//! ```
//!
//! Power is torque times speed, so `r` keeps the gain of these loops what it is at `w_power` (with generating torque, up to
//! 1.4 times that speed). Near standstill the
//! copper losses take all that the shaft gives: below `slow` nothing is limited. With a resistor that can still take
//! energy, generating torque is limited above the chopper's band alone.
//!
//! A sagging mains and one that is gone look alike at first: motoring torque is taken away. Without load the link of a
//! sagging mains stays where it is, and `held` gives way below it, so that the torque comes back; in an outage the shaft
//! holds the link at `held`.

use crate::io::PERIOD_S;

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
/// Share of the slow speed above it within which the limits come on.
const FADES: f32 = 0.25;
/// Braking by flux begins where this share of the generating torque is left, and is whole where half of it is.
const FLUX_FROM: f32 = 0.75;
const FLUX_GAIN: f32 = 4.0;
/// The duty goes down over the last tenth of what the resistor can take.
const COOL_GAIN: f32 = 10.0;

/// A brake resistor behind a chopper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChopperSettings {
    /// Voltage at which it begins to conduct, V.
    pub on_v: f32,
    /// Voltage from which on it conducts throughout, V.
    pub full_v: f32,
    /// Resistance, ohm.
    pub resistance: f32,
    /// Energy that it takes from cold, J.
    pub energy_j: f32,
    /// Power that it takes for ever, W.
    pub power_w: f32,
}

/// Settings of the limits. Speeds are mechanical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcLinkSettings {
    /// Voltage from which on generating torque is limited, V.
    pub from_v: f32,
    /// Voltage without generating torque, V.
    pub high_v: f32,
    /// Voltage without motoring torque, V; below, the shaft feeds the link.
    pub low_v: f32,
    /// Voltage down to which the latter gives way when the link stays low, V.
    pub floor_v: f32,
    /// How fast, V/s.
    pub yield_v_per_s: f32,
    /// Direct current that is added while generating torque is limited, A; 0 for none.
    pub flux_a: f32,
    /// Speed above which it is, rpm: the flux must be back when the carrier comes on.
    pub flux_rpm: f32,
    /// Speed below which nothing is limited, rpm.
    pub slow_rpm: f32,
    /// Speed above which gains go down with the speed, rpm.
    pub power_rpm: f32,
    /// The brake resistor, if there is one.
    pub chopper: Option<ChopperSettings>,
}

impl Default for DcLinkSettings {
    /// For 311 V and four poles, without resistor.
    fn default() -> Self {
        Self {
            from_v: 340.0,
            high_v: 390.0,
            low_v: 260.0,
            floor_v: 215.0,
            yield_v_per_s: 100.0,
            flux_a: 1.0,
            flux_rpm: 1200.0,
            slow_rpm: 270.0,
            power_rpm: 1800.0,
            chopper: None,
        }
    }
}

/// Why torque is limited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Limiting {
    /// It is not.
    #[default]
    No,
    /// Generating torque: the link is high.
    DcLinkHigh,
    /// Generating torque: the link is high, and the brake resistor has taken all that it can.
    ResistorHot,
    /// Motoring torque: the link is low.
    DcLinkLow,
    /// The shaft feeds the link, which has no supply.
    RideThrough,
}

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    pub fn hold(&self, i_q: f32) -> (f32, Limiting) {
        if i_q < self.i_q.0 {
            (self.i_q.0, self.why.0)
        } else if i_q > self.i_q.1 {
            (self.i_q.1, self.why.1)
        } else {
            (i_q, Limiting::No)
        }
    }
}

/// A setting of the dc link outside its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcLinkError {
    /// Name of the setting.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The value.
    pub value: f32,
    /// Smallest allowed.
    pub min: f32,
    /// Largest allowed.
    pub max: f32,
}

impl core::fmt::Display for DcLinkError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { name, unit, value, min, max } = self;
        write!(f, "{name} = {value}: allowed is {min} to {max} {unit}")
    }
}

impl core::error::Error for DcLinkError {}

impl DcLinkSettings {
    /// Checks every value; the link must stay between `under_v` and `over_v`, V, where the drive trips.
    ///
    /// # Errors
    /// The first value outside its range.
    pub fn check(&self, under_v: f32, over_v: f32) -> Result<(), DcLinkError> {
        let of = |name, unit, value: f32, min: f32, max: f32| {
            // A value that is not a number is outside.
            let inside = (min..=max).contains(&value);
            if inside { Ok(()) } else { Err(DcLinkError { name, unit, value, min, max }) }
        };
        let s = self;
        of("dc_link.high_v", "V", s.high_v, under_v, over_v)?;
        of("dc_link.from_v", "V", s.from_v, 0.5 * s.high_v, 0.99 * s.high_v)?;
        of("dc_link.low_v", "V", s.low_v, under_v, s.from_v)?;
        of("dc_link.floor_v", "V", s.floor_v, under_v, 0.99 * s.low_v)?;
        of("dc_link.yield_v_per_s", "V/s", s.yield_v_per_s, 0.0, 1e5)?;
        of("dc_link.flux_a", "A", s.flux_a, 0.0, 1000.0)?;
        of("dc_link.slow_rpm", "rpm", s.slow_rpm, 1.0, 20_000.0)?;
        of("dc_link.flux_rpm", "rpm", s.flux_rpm, s.slow_rpm, 24_000.0)?;
        of("dc_link.power_rpm", "rpm", s.power_rpm, s.slow_rpm, 24_000.0)?;
        let Some(chopper) = s.chopper else { return Ok(()) };
        of("chopper.full_v", "V", chopper.full_v, s.from_v, over_v)?;
        of("chopper.on_v", "V", chopper.on_v, 0.5 * chopper.full_v, 0.999 * chopper.full_v)?;
        of("chopper.resistance", "ohm", chopper.resistance, 0.1, 1e5)?;
        of("chopper.energy_j", "J", chopper.energy_j, 1.0, 1e7)?;
        of("chopper.power_w", "W", chopper.power_w, 0.1, 1e5)
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
    /// How far the held voltage gives way at most.
    room: f32,
    /// Change of the held voltage in a step.
    gives: f32,
    rise: f32,
    flux_a: f32,
    flux_freq: f32,
    slow_freq: f32,
    per_slow: f32,
    power_freq: f32,
    chopper: Option<Chopper>,
}

/// State of the limits. It is kept over stops and starts: the resistor stays hot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DcLinkState {
    /// Smoothed voltage, V; none before the first step.
    v: Option<f32>,
    /// By how much the held voltage has given way, V.
    given: f32,
    /// Heat of the brake resistor; 1 is all that it can take.
    pub heat: f32,
}

/// How far `v` is below the upper end of a band, in relation to its width divided by `gain`.
fn below((from, high): (f32, f32), v: f32, gain: f32) -> f32 {
    (gain * (high - v) / (high - from)).clamp(0.0, 1.0)
}

impl DcLink {
    /// Limits with these settings for a drive that trips below `under_v` and above `over_v`, V, and whose speed is
    /// `freq_per_rpm` electrical turns per control period at 1 rpm.
    ///
    /// # Errors
    /// As [`DcLinkSettings::check`].
    pub fn new(
        settings: &DcLinkSettings,
        under_v: f32,
        over_v: f32,
        freq_per_rpm: f32,
    ) -> Result<Self, DcLinkError> {
        settings.check(under_v, over_v)?;
        let s = settings;
        Ok(Self {
            band: (s.from_v, s.high_v),
            low: s.low_v,
            room: s.low_v - s.floor_v,
            gives: s.yield_v_per_s * STEP_S,
            rise: (s.low_v - s.floor_v) * RISE,
            flux_a: s.flux_a,
            flux_freq: s.flux_rpm * freq_per_rpm,
            slow_freq: s.slow_rpm * freq_per_rpm,
            per_slow: 1.0 / (FADES * s.slow_rpm * freq_per_rpm),
            power_freq: s.power_rpm * freq_per_rpm,
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
        })
    }

    /// One step with the measured dc link `dc_link`, V, at the speed `freq` of the rotor, electrical turns per control
    /// period, for torque currents within `i_q_limit`, A.
    pub fn step(
        &self,
        state: &mut DcLinkState,
        dc_link: f32,
        freq: f32,
        i_q_limit: f32,
    ) -> DcLinkLimits {
        let before = state.v.unwrap_or(dc_link);
        let v = before + 0.5 * (dc_link - before);
        state.v = Some(v);
        let speed = freq.abs();
        let gain = if speed > self.power_freq { self.power_freq / speed } else { 1.0 };
        let down = if gain < 1.0 / WIDEST { 1.0 / WIDEST } else { gain };
        // Below `slow` nothing is limited.
        let weight = ((speed - self.slow_freq) * self.per_slow).clamp(0.0, 1.0);

        let (chopper, cold) = self.brake(state, v);
        let generating = match &self.chopper {
            None => below(self.band, v, down),
            Some(c) => {
                let (alone, with) = (below(self.band, v, down), below(c.band, v, down));
                alone + cold * (with - alone)
            }
        };
        let flux = (FLUX_GAIN * (FLUX_FROM - generating)).clamp(0.0, 1.0);
        let flux_a = if speed > self.flux_freq { flux * self.flux_a } else { 0.0 };

        // 1 at the upper end of the band of motoring torque.
        let above = gain * (v - self.low + state.given) / self.rise;
        self.give_way(state, above);
        let motoring = if above < 0.0 {
            (RISE_OF_DEPTH * above).clamp(-1.0, 0.0)
        } else {
            above.clamp(0.0, 1.0)
        };

        let limit = |share: f32| (1.0 - weight + weight * share) * i_q_limit;
        let (motoring, generating) = (limit(motoring), limit(generating));
        let high = if self.chopper.is_some() && cold < 1.0 {
            Limiting::ResistorHot
        } else {
            Limiting::DcLinkHigh
        };
        let low = if motoring < 0.0 { Limiting::RideThrough } else { Limiting::DcLinkLow };
        let (i_q, why) = if freq < 0.0 {
            ((-motoring, generating), (low, high))
        } else {
            ((-generating, motoring), (high, low))
        };
        DcLinkLimits { i_q, why, flux_a, chopper }
    }

    /// Duty of the chopper, and how much of it the heat of the resistor leaves.
    fn brake(&self, state: &mut DcLinkState, v: f32) -> (f32, f32) {
        let Some(c) = &self.chopper else { return (0.0, 0.0) };
        let cold = (COOL_GAIN * (1.0 - state.heat)).clamp(0.0, 1.0);
        let duty = cold * ((v - c.on) * c.per_band).clamp(0.0, 1.0);
        state.heat += duty * c.per_square * v * v - c.cooling * state.heat;
        (duty, cold)
    }

    /// Lets the held voltage give way while motoring torque is limited, and come back with room to spare; `above` is
    /// how far up its band the link is.
    fn give_way(&self, state: &mut DcLinkState, above: f32) {
        if above < 1.0 {
            state.given += self.gives;
        } else if above > 2.0 {
            state.given -= self.gives;
        }
        state.given = state.given.clamp(0.0, self.room);
    }
}

#[cfg(test)]
mod tests;
