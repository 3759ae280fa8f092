//! Voltage in proportion to the frequency: turns a motor that nobody has identified, from its nameplate alone.
//!
//! The frame turns with the stator's frequency; its d axis is that of the flux in the steady state. With `psi` the flux of
//! the nameplate, `i_0` the boost current and `R` the resistance that the boost has shown:
//!
//! ```text
//! boost    u_d = PI(i_0 - |i|), standing along phase a, then R = u_d/i_0     the voltage that the standing motor needs
//! voltage  u   = R i_0 + j (s psi w + 0.55 R i_q)                            s: share of the flux, see below
//! limit    u  -= 0.6 Z (1 - I/|i|) i                 beyond the current limit I; Z: base impedance of the nameplate
//! slip     f_2 = f_n (3/2) p psi_n^2 i_q/(T_n s psi)                         rated slip and torque f_n, T_n; 0.1 s
//! stator   f   = ramp + f_2 - damping (i_q - mean of i_q)
//! ramp    -= K (i_q - i_q within its limits)
//! ```
//!
//! The currents of the last three lines are measured. Torque that does not fit into the current limit, or that the dc link
//! does not bear, thus changes the speed: the motor slows down under a load that is too heavy, and brakes no faster than the
//! link allows. The share `s` goes down to 0.65 where the reactive current alone takes 0.55 of the limit, and further where
//! the link has no more voltage. More than the shown share of `R i_q`, or less damping, makes motors hunt below 10 Hz.
//!
//! A phase that opens shows as a current that turns backwards. Nothing here knows the rotor. A current beyond the limit for
//! 20 ms is taken for a motor that has pulled out: the frequency goes down until the current does. A motor that stays at its
//! limits below 4 Hz for two seconds is taken for one that stands.
//!
//! Simulated with eight motors of 0.19 to 18.5 kW whose drive knew the nameplate injection_only: half the rated speed within 1 % of
//! the rated one without load, within 3 % with 0.3 of the rated torque.

use crate::math::{limited, within};
use crate::{AlphaBeta, Angle, Dq, Fault, PERIOD_S, UnitVector};

/// Gains of the boost, as shares of the base impedance: proportional, and per second.
const BOOST_K: f32 = 0.03;
const BOOST_PER_S: f32 = 0.5;
/// Largest voltage of the boost: that of this share of the base impedance, which no stator resistance reaches.
const BOOST_MOST: f32 = 0.3;
/// Tolerance of the boost current, and control periods for which it must hold, 0.5 s: the flux has built up by then in most
/// motors.
const BOOST_WITHIN: f32 = 0.05;
const BOOST_HOLDS: u32 = 3000;
/// Share of the voltage across the resistance that is added for the torque current: 1 would be on the verge of stability.
const COMPENSATED: f32 = 0.55;
/// Resistance that limits the current, as a share of the base impedance.
const LIMITING: f32 = 0.6;
/// Share of the current limit from which on the torque current makes the frequency give way.
const FOLD_BACK_FROM: f32 = 0.83;
/// Least time for a change by the rated frequency, s: the flux of most motors follows.
const STEEPEST_S: f32 = 2.0;
/// Share of it that must be left for the whole acceleration.
const LEAST_RAMP_SHARE: f32 = 0.25;
/// A current beyond the limit for these control periods, 20 ms, is that of a motor that has pulled out. The frequency then
/// goes down, the rated one in this time, s, until the current is below this share of the limit.
const PULLED_OUT: u32 = 120;
const RECOVERY_S: f32 = 0.5;
const RECOVERED: f32 = 0.75;
/// Control periods for which the motor may be at its limit below this frequency, 2 s, four for each.
const STALLED: u32 = 4 * 12_000;
const STALLED_BELOW: f32 = 4.0 * PERIOD_S;
/// Time in which an excess of the whole current limit would take the rated frequency off, s.
const EXCESS_S: f32 = 0.34;
/// Largest share of the current limit for the reactive current, and time in which the flux follows, s.
const REACTIVE: f32 = 0.55;
const TRIM_S: f32 = 0.75;
/// Least share of the flux.
const LEAST_FLUX: f32 = 0.65;
/// Share of the rated frequency that the torque current takes off while it changes by the rated current.
const DAMPING: f32 = 0.15;
/// Time constants of the currents for limits, damping, and slip, s.
const FAST: f32 = PERIOD_S / 0.002;
const SLOW: f32 = PERIOD_S / 0.08;
const SLIP: f32 = PERIOD_S / 0.1;
/// Frequency from which on the whole slip is compensated: a motor that is to stand gets a field that stands.
const SLIP_WHOLE_FROM: f32 = 3.0 * PERIOD_S;
/// The current that turns backwards: time constant, largest share of the whole, frequency from which on it is measured,
/// and after how many control periods it is judged, 0.5 s.
const BACKWARDS: f32 = PERIOD_S / 0.1;
const BACKWARDS_SQUARED: f32 = 0.4 * 0.4;
const JUDGED_FROM: f32 = 8.0 * PERIOD_S;
const JUDGED_AFTER: u32 = 3000;
/// Across the boost, a sensor with the wrong sign or two that are exchanged make 1.15 or more of the current along it; the dead
/// time of an inverter of low voltage makes up to 0.58, as an open phase would, which shows later.
const ACROSS: f32 = 0.7;
const ACROSS_OF_POLARITY: f32 = 0.8;
/// Share of the circle inside the hexagon that is used.
const MODULATION_SHARE: f32 = 0.97;
/// Periods from the sample to the middle of the period of its voltage.
const VOLTAGE_DELAY: f32 = 1.5;

/// Nameplate and limits; the voltages are peaks of a phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltsPerHertzSettings {
    /// Voltage per frequency, V/Hz.
    pub volts_per_hz: f32,
    /// The same of the nameplate.
    pub rated_volts_per_hz: f32,
    /// Rated frequency, Hz.
    pub frequency_hz: f32,
    /// Rated slip, Hz.
    pub slip_hz: f32,
    /// Rated torque, Nm.
    pub torque_nm: f32,
    /// Pairs of poles.
    pub pole_pairs: f32,
    /// Rated current, A peak.
    pub rated_a: f32,
    /// Current limit, A peak.
    pub limit_a: f32,
    /// Boost, A peak.
    pub boost_a: f32,
    /// Base impedance, ohm.
    pub impedance: f32,
    /// Voltage that the inverter may lose at the boost, V.
    pub lost_v: f32,
    /// Change of the frequency, Hz/s.
    pub ramp_hz_per_s: f32,
    /// That of a quick stop, Hz/s.
    pub quick_hz_per_s: f32,
    /// Share of the slip that is compensated.
    pub slip_share: f32,
}

/// Coefficients. Frequencies in electrical turns per control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltsPerHertz {
    /// V per frequency.
    volts: f32,
    /// Slip per torque current at the whole flux.
    slip: f32,
    /// Current of the standing motor, A.
    pub boost_a: f32,
    boost: (f32, f32),
    most_v: f32,
    limit_a: f32,
    limiting: f32,
    reactive_a: f32,
    per_excess: f32,
    damping: f32,
    ramp: f32,
    quick_ramp: f32,
    recovery: f32,
    per_room: f32,
}

/// State.
#[derive(Clone, Copy, Debug, Default)]
pub struct VoltsPerHertzState {
    angle: Angle,
    /// Speed of the rotor, electrical turns per period: the ramped frequency, without the slip.
    pub rotor_freq: f32,
    /// Frequency of the stator.
    pub freq: f32,
    /// Slip of the rotor.
    pub slip: f32,
    /// Voltage of the boost, V, and periods for which its current has held.
    boost: f32,
    held: u32,
    fast: Dq,
    slow: Dq,
    backwards: Dq,
    /// Periods for which it was measured.
    measured: u32,
    /// Periods beyond the limit, and at it at a low frequency, four for each.
    beyond: u32,
    stalled: u32,
    /// Whether the motor has pulled out.
    recovers: bool,
    /// Share of the flux that the reactive current leaves; the boost sets it to 1.
    flux: f32,
    /// Whether the dc link has no more voltage at this frequency.
    pub by_voltage: bool,
}

/// Demand and limits of a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Frequency of the rotor that is asked for, electrical turns per period.
    pub freq: f32,
    /// Whether by the ramp of a quick stop.
    pub quick: bool,
    /// Least and largest torque current, A.
    pub i_q: (f32, f32),
    /// Largest voltage, V.
    pub largest_v: f32,
}

/// A period's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turned {
    /// Frame of the current.
    pub angle: Angle,
    /// Frame in which the voltage will act.
    pub applied: UnitVector,
    /// Measured current, A.
    pub current: Dq,
    /// Voltage, V.
    pub voltage: Dq,
}

impl VoltsPerHertz {
    /// For a motor with these data, all greater than zero.
    pub fn new(s: &VoltsPerHertzSettings) -> Self {
        const TAU: f32 = core::f32::consts::TAU;
        let (rated, flux) = (s.rated_volts_per_hz / TAU, s.volts_per_hz / TAU);
        let steepest = s.frequency_hz / STEEPEST_S;
        let ramp = |hz_per_s: f32| limited(hz_per_s, steepest) * PERIOD_S * PERIOD_S;
        let slip_hz = s.slip_hz * 1.5 * s.pole_pairs * rated * rated / (flux * s.torque_nm);
        Self {
            volts: s.volts_per_hz / PERIOD_S,
            slip: s.slip_share * slip_hz * PERIOD_S,
            boost_a: s.boost_a,
            boost: (BOOST_K * s.impedance, BOOST_PER_S * s.impedance * PERIOD_S),
            most_v: BOOST_MOST * s.impedance * s.boost_a + s.lost_v,
            limit_a: s.limit_a,
            limiting: LIMITING * s.impedance,
            reactive_a: REACTIVE * s.limit_a,
            per_excess: s.frequency_hz * PERIOD_S * (PERIOD_S / EXCESS_S) / s.limit_a,
            damping: DAMPING * s.frequency_hz * PERIOD_S / s.rated_a,
            ramp: ramp(s.ramp_hz_per_s),
            quick_ramp: ramp(s.quick_hz_per_s),
            per_room: 1.0 / (LEAST_RAMP_SHARE * s.limit_a),
            recovery: s.frequency_hz * PERIOD_S * (PERIOD_S / RECOVERY_S),
        }
    }

    /// One period with the measured `current`, A.
    ///
    /// # Errors
    /// While the boost rises [`Fault::WiringNoCurrent`], [`Fault::WiringPolarityA`], [`Fault::WiringPolarityB`] or
    /// [`Fault::WiringExchanged`]; later [`Fault::CurrentNotAsPredicted`] where the current turns backwards.
    pub fn step(
        &self,
        state: &mut VoltsPerHertzState,
        current: AlphaBeta,
        demand: &Demand,
    ) -> Result<Turned, Fault> {
        let axis = state.angle.unit_vector();
        let seen = current.to_dq(axis);
        state.fast += (seen - state.fast) * FAST;
        state.slow += (state.fast - state.slow) * SLOW;
        let turning = self.is_built(state);
        let mut voltage = if turning {
            let backwards = current.to_dq(UnitVector { cos: axis.cos, sin: -axis.sin });
            self.judge(state, backwards)?;
            self.turn(state, demand)?
        } else {
            self.rise(state, current)?
        };
        let square = seen.length_squared();
        if square > self.limit_a * self.limit_a {
            let beyond = 1.0 - self.limit_a / fpu_sqrt::sqrtf(square);
            voltage -= seen * (self.limiting * beyond);
        }
        let angle = state.angle;
        let applied = (angle + Angle::from_turns(VOLTAGE_DELAY * state.freq)).unit_vector();
        state.angle = angle + Angle::from_turns(state.freq);
        Ok(Turned { angle, applied, current: seen, voltage })
    }

    /// Whether the boost stands, and references act.
    pub fn is_built(&self, state: &VoltsPerHertzState) -> bool {
        state.held >= BOOST_HOLDS
    }

    /// The voltage of a motor that stands, while its current rises.
    fn rise(&self, state: &mut VoltsPerHertzState, current: AlphaBeta) -> Result<Dq, Fault> {
        let length = fpu_sqrt::sqrtf(current.length_squared());
        let error = self.boost_a - length;
        state.boost += self.boost.1 * error;
        if state.boost > self.most_v {
            return Err(Fault::WiringNoCurrent);
        }
        let holds = error.abs() < BOOST_WITHIN * self.boost_a;
        state.held = if holds { state.held + 1 } else { 0 };
        state.flux = 1.0;
        if self.is_built(state) {
            wired(current)?;
        }
        Ok(Dq { d: state.boost + self.boost.0 * error, q: 0.0 })
    }

    /// Brings the frequency to the one that is asked for, as far as the current allows.
    fn follow(&self, state: &mut VoltsPerHertzState, demand: &Demand) -> Result<(), Fault> {
        let (square, limit) = (state.fast.length_squared(), self.limit_a * self.limit_a);
        let most = FOLD_BACK_FROM * FOLD_BACK_FROM * limit - state.slow.d * state.slow.d;
        let most = if most > 0.0 { fpu_sqrt::sqrtf(most) } else { 0.0 };
        let i_q = state.fast.q;
        let range = (within(-most, demand.i_q), within(most, demand.i_q));
        let excess = i_q - within(i_q, range);
        let ramp = if demand.quick { self.quick_ramp } else { self.ramp };
        let step = limited(demand.freq - state.rotor_freq, ramp);
        // Less acceleration, the less torque current is left for it.
        let room = if step < 0.0 { i_q - range.0 } else { range.1 - i_q };
        let share = within(room * self.per_room, (0.0, 1.0));

        state.beyond = if square > limit { state.beyond + 1 } else { 0 };
        state.recovers |= state.beyond > PULLED_OUT;
        state.recovers &= square > RECOVERED * RECOVERED * limit;
        state.rotor_freq += if state.recovers {
            -limited(state.rotor_freq, self.recovery)
        } else {
            share * step - self.per_excess * excess
        };

        let at_limit = state.recovers || excess != 0.0 || share < 0.25;
        let stands = at_limit && state.rotor_freq.abs() < STALLED_BELOW;
        state.stalled = if stands { state.stalled + 4 } else { state.stalled.saturating_sub(1) };
        Fault::Stalled.unless(state.stalled <= STALLED)
    }

    /// The voltage of a motor that turns.
    fn turn(&self, state: &mut VoltsPerHertzState, demand: &Demand) -> Result<Dq, Fault> {
        self.follow(state, demand)?;
        let room = (self.reactive_a - state.slow.d) * (5.0 / self.reactive_a);
        let flux = state.flux + limited(room, 1.0) * (PERIOD_S / TRIM_S);
        state.flux = within(flux, (LEAST_FLUX, 1.0));
        let whole = self.volts * state.freq;
        // The drop of the resistance comes first.
        let resistance = state.boost / self.boost_a;
        let drop = COMPENSATED * resistance * state.slow.q;
        let left = MODULATION_SHARE * demand.largest_v - drop.abs() - state.boost;
        let wanted = state.flux * whole.abs();
        state.by_voltage = wanted > left;
        let flux = if state.by_voltage { state.flux * left / wanted } else { state.flux };
        let flux = within(flux, (LEAST_FLUX, 1.0));

        let fades = within(state.rotor_freq.abs() * (1.0 / SLIP_WHOLE_FROM), (0.0, 1.0));
        let slip = fades * self.slip * state.slow.q / flux;
        state.slip += SLIP * (slip - state.slip);
        state.freq = state.rotor_freq + state.slip - self.damping * (state.fast.q - state.slow.q);
        Ok(Dq { d: state.boost, q: flux * whole + drop })
    }

    /// Checks that all three phases carry the current, by its part that turns backwards.
    fn judge(&self, state: &mut VoltsPerHertzState, backwards: Dq) -> Result<(), Fault> {
        if state.freq.abs() < JUDGED_FROM {
            (state.backwards, state.measured) = (Dq::ZERO, 0);
            return Ok(());
        }
        state.backwards += (backwards - state.backwards) * BACKWARDS;
        state.measured = state.measured.saturating_add(1);
        let most = BACKWARDS_SQUARED * state.slow.length_squared();
        if state.measured > JUDGED_AFTER && state.backwards.length_squared() > most {
            return Err(Fault::CurrentNotAsPredicted);
        }
        Ok(())
    }
}

/// Checks that a voltage along phase a makes a current along phase a.
fn wired(i: AlphaBeta) -> Result<(), Fault> {
    let along = i.alpha.abs();
    if i.alpha > 0.0 && i.beta.abs() < ACROSS * along {
        Ok(())
    } else if i.beta > ACROSS_OF_POLARITY * along {
        Err(if i.alpha > 0.0 { Fault::WiringPolarityB } else { Fault::WiringExchanged })
    } else if i.alpha < 0.0 {
        Err(Fault::WiringPolarityA)
    } else {
        Err(Fault::WiringNoCurrent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    fn coefficients() -> VoltsPerHertz {
        Settings::default().build().unwrap().volts_per_hertz.unwrap()
    }

    /// The answer to a voltage along phase a, by the direction of the current in degrees.
    #[test]
    fn the_direction_of_the_current_tells_the_wiring() {
        for (from, to, expected) in [
            (-34, 34, Ok(())),
            (36, 38, Err(Fault::WiringNoCurrent)),
            (39, 89, Err(Fault::WiringPolarityB)),
            (91, 141, Err(Fault::WiringExchanged)),
            (142, 269, Err(Fault::WiringPolarityA)),
            (271, 324, Err(Fault::WiringNoCurrent)),
        ] {
            for degrees in from..=to {
                let axis = Angle::from_turns(degrees as f32 / 360.0).unit_vector();
                assert_eq!(wired(AlphaBeta::along(axis, 0.7)), expected, "{degrees}");
            }
        }
        assert_eq!(wired(AlphaBeta::ZERO), Err(Fault::WiringNoCurrent));
    }

    /// At its limit below 4 Hz for two seconds, or for a part of the time for longer: more than a fifth of it counts.
    #[test]
    fn a_motor_at_its_limit_that_hardly_turns_stands() {
        let coefficients = coefficients();
        let limit = coefficients.limit_a;
        let demand =
            Demand { freq: 10.0 * PERIOD_S, quick: false, i_q: (-limit, limit), largest_v: 170.0 };
        for (hz, every, expected) in [
            (3.9, 1, Some(12_001)),
            (-3.9, 1, Some(12_001)),
            (3.9, 4, Some(4 * 47_997 + 1)),
            (3.9, 6, None),
            (4.1, 1, None),
        ] {
            let mut state = VoltsPerHertzState::default();
            let found = (1..200_000).find(|n| {
                let q = if n % every == 1 % every { 0.95 * limit } else { 0.0 };
                (state.fast, state.rotor_freq) = (Dq { d: 0.0, q }, hz * PERIOD_S);
                coefficients.follow(&mut state, &demand) == Err(Fault::Stalled)
            });
            assert_eq!(found, expected, "{hz} Hz, one of {every}");
        }
    }

    /// More than 0.4 of the current turns backwards for half a second, at 8 Hz or faster without a break.
    #[test]
    fn a_current_that_turns_backwards_is_an_open_phase() {
        let coefficients = coefficients();
        for (hz, share, slow_at, expected) in [
            (8.1, 0.41, 0, Some(3001)),
            (-8.1, 0.41, 0, Some(3001)),
            (8.1, 0.41, 2000, Some(5001)),
            (8.1, 0.39, 0, None),
            (7.9, 0.9, 0, None),
        ] {
            let slow = Dq { d: 1.2, q: -1.6 };
            let mut state = VoltsPerHertzState { slow, ..Default::default() };
            let backwards = Dq { d: 1.6 * share, q: 1.2 * share };
            let found = (1..9000).find(|&n| {
                state.freq = PERIOD_S * if n == slow_at { 7.9 } else { hz };
                coefficients.judge(&mut state, backwards) == Err(Fault::CurrentNotAsPredicted)
            });
            assert_eq!(found, expected, "{hz} Hz, {share}");
        }
    }
}
