//! V/f control: voltage in proportion to the frequency, for a motor that was not identified, from its nameplate alone.
//!
//! The frame rotates with the stator frequency; its d axis is the flux axis in the steady state. With `psi` the flux of
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
//! The currents of the last three lines are measured. Torque beyond the current limit or beyond the limits of the dc link
//! therefore changes the speed (stall prevention): the motor slows down under a load that is too heavy, and brakes no faster
//! than the link allows. The share `s` falls to 0.65 if the reactive current alone is 0.55 of the limit, and further if the
//! link has no more voltage. With more than the shown share of `R i_q`, or with less damping, motors hunt below 10 Hz.
//!
//! An open phase shows as a current that rotates backwards. There is no model of the rotor. A current beyond the limit for
//! 20 ms means that the motor has pulled out; then the frequency falls until the current does. A motor that stays at its
//! limits below 4 Hz for two seconds counts as stalled.
//!
//! In simulations of eight motors of 0.19 to 18.5 kW with the nameplate alone, half the rated speed was reached within 1 %
//! of the rated speed without load, and within 3 % with 0.3 of the rated torque.

use crate::blocks::Vf;
use crate::math::{limited, within};
use crate::{AlphaBeta, Angle, Dq, Fault, PERIOD_S, UnitVector};

/// Gains of the boost controller, as shares of the base impedance: proportional, and per second.
const BOOST_K: f32 = 0.03;
const BOOST_PER_S: f32 = 0.5;
/// Largest voltage of the boost, as a share of the base impedance, which no stator resistance reaches.
const BOOST_MOST: f32 = 0.3;
/// Tolerance of the boost current, and control periods for which the current must stay within it, 0.5 s. Then the flux of
/// most motors has built up.
const BOOST_WITHIN: f32 = 0.05;
const BOOST_HOLDS: u32 = 3000;
/// Share of the voltage across the resistance that is added for the q-axis current: 1 would be on the verge of stability.
const COMPENSATED: f32 = 0.55;
/// Resistance that limits the current, as a share of the base impedance.
const LIMITING: f32 = 0.6;
/// Share of the current limit above which the q-axis current changes the frequency (stall prevention).
const FOLD_BACK_FROM: f32 = 0.83;
/// Least time for a change by the rated frequency, s, in which the flux of most motors can follow.
const STEEPEST_S: f32 = 2.0;
/// Share of the current limit that must be left for the full acceleration.
const LEAST_RAMP_SHARE: f32 = 0.25;
/// Control periods, 20 ms, after which a current beyond the limit means that the motor has pulled out; time in which the
/// frequency then falls by the rated frequency, s; and share of the limit below which the current must fall.
const PULLED_OUT: u32 = 120;
const RECOVERY_S: f32 = 0.5;
const RECOVERED: f32 = 0.75;
/// Control periods for which the motor may be at its limit below this frequency, 2 s, counted as four each.
const STALLED: u32 = 4 * 12_000;
const STALLED_BELOW: f32 = 4.0 * PERIOD_S;
/// Time in which an excess by the whole current limit would reduce the frequency by the rated frequency, s.
const EXCESS_S: f32 = 0.34;
/// Largest share of the current limit for the reactive current, and time in which the flux follows, s.
const REACTIVE: f32 = 0.55;
const TRIM_S: f32 = 0.75;
/// Least share of the flux.
const LEAST_FLUX: f32 = 0.65;
/// Share of the rated frequency by which a change of the q-axis current by the rated current reduces the frequency.
const DAMPING: f32 = 0.15;
/// Time constants of the currents for limits, damping, and slip, s.
const FAST: f32 = PERIOD_S / 0.002;
const SLOW: f32 = PERIOD_S / 0.08;
const SLIP: f32 = PERIOD_S / 0.1;
/// Frequency above which the whole slip is compensated. A motor that is to be at rest gets a fixed field.
const SLIP_WHOLE_FROM: f32 = 3.0 * PERIOD_S;
/// The current that rotates backwards: time constant, largest share of the whole current, frequency above which it is
/// measured, and control periods after which it is judged, 0.5 s.
const BACKWARDS: f32 = PERIOD_S / 0.1;
const BACKWARDS_SQUARED: f32 = 0.4 * 0.4;
const JUDGED_FROM: f32 = 8.0 * PERIOD_S;
const JUDGED_AFTER: u32 = 3000;
/// Largest current across the boost, relative to the current along it. A sensor with the wrong sign or two exchanged sensors
/// cause 1.15 or more. The dead time of an inverter of low voltage causes up to 0.58, and so does an open phase, which is
/// detected later.
const ACROSS: f32 = 0.7;
const ACROSS_OF_POLARITY: f32 = 0.8;
/// Share of the circle inside the hexagon that is used.
const MODULATION_SHARE: f32 = 0.97;
/// Periods from the sample to the middle of the period of its voltage.
const VOLTAGE_DELAY: f32 = 1.5;

/// Nameplate and limits. The voltages are phase peak values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltsPerHertzSettings {
    /// Voltage per frequency, V/Hz.
    pub volts_per_hz: f32,
    /// Voltage per frequency of the nameplate, V/Hz.
    pub rated_volts_per_hz: f32,
    /// Rated frequency, Hz.
    pub frequency_hz: f32,
    /// Rated slip, Hz.
    pub slip_hz: f32,
    /// Rated torque, Nm.
    pub torque_nm: f32,
    /// Pole pairs.
    pub pole_pairs: f32,
    /// Rated current, A peak.
    pub rated_a: f32,
    /// Current limit, A peak.
    pub limit_a: f32,
    /// Boost current, A peak.
    pub boost_a: f32,
    /// Base impedance, ohm.
    pub impedance: f32,
    /// Largest inverter voltage error at the boost, V.
    pub lost_v: f32,
    /// Change of the frequency, Hz/s.
    pub ramp_hz_per_s: f32,
    /// Change of the frequency in a quick stop, Hz/s.
    pub quick_hz_per_s: f32,
    /// Share of the slip that is compensated.
    pub slip_share: f32,
}

/// Coefficients of the V/f control. Frequencies are in electrical turns per control period.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct VoltsPerHertz {
    /// See [`blocks`](crate::blocks).
    pub built: Vf,
    /// Voltage per frequency, V.
    volts: f32,
    /// Slip per q-axis current at full flux.
    slip: f32,
    /// Current of the motor at rest, A.
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

/// State of the V/f control.
#[derive(Clone, Copy, Debug, Default)]
pub struct VoltsPerHertzState {
    angle: Angle,
    /// Speed of the rotor, electrical turns per period: the ramped frequency, without the slip.
    pub rotor_freq: f32,
    /// Frequency of the stator.
    pub freq: f32,
    /// Slip of the rotor.
    pub slip: f32,
    /// Voltage of the boost, V, and periods for which its current has been within the tolerance.
    boost: f32,
    held: u32,
    fast: Dq,
    slow: Dq,
    backwards: Dq,
    /// Periods for which the backwards current was measured.
    measured: u32,
    /// Periods with a current beyond the limit, and periods at the limit at a low frequency, counted as four each.
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
    /// Reference of the rotor frequency, electrical turns per period.
    pub freq: f32,
    /// Whether the ramp is that of a quick stop.
    pub quick: bool,
    /// Least and largest q-axis current, A.
    pub i_q: (f32, f32),
    /// Largest voltage, V.
    pub largest_v: f32,
}

/// Result of a period.
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
    /// Creates the V/f control for a motor with these data, all greater than zero; `None` in a build without it.
    pub fn new(s: &VoltsPerHertzSettings) -> Option<Self> {
        const TAU: f32 = core::f32::consts::TAU;
        let (rated, flux) = (s.rated_volts_per_hz / TAU, s.volts_per_hz / TAU);
        let steepest = s.frequency_hz / STEEPEST_S;
        let ramp = |hz_per_s: f32| limited(hz_per_s, steepest) * PERIOD_S * PERIOD_S;
        let slip_hz = s.slip_hz * 1.5 * s.pole_pairs * rated * rated / (flux * s.torque_nm);
        Some(Self {
            built: Vf::IN_BUILD?,
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
        })
    }

    /// Runs one period with the measured `current`, A.
    ///
    /// # Errors
    /// While the boost rises [`Fault::WiringNoCurrent`], [`Fault::WiringPolarityA`], [`Fault::WiringPolarityB`] or
    /// [`Fault::WiringExchanged`]; later [`Fault::CurrentNotAsPredicted`] if the current rotates backwards.
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

    /// Whether the boost has built up, so that references take effect.
    pub fn is_built(&self, state: &VoltsPerHertzState) -> bool {
        state.held >= BOOST_HOLDS
    }

    /// Returns the voltage of a motor at rest while the boost current rises.
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

    /// Changes the frequency towards its reference as far as the current allows.
    fn follow(&self, state: &mut VoltsPerHertzState, demand: &Demand) -> Result<(), Fault> {
        let (square, limit) = (state.fast.length_squared(), self.limit_a * self.limit_a);
        let most = FOLD_BACK_FROM * FOLD_BACK_FROM * limit - state.slow.d * state.slow.d;
        let most = if most > 0.0 { fpu_sqrt::sqrtf(most) } else { 0.0 };
        let i_q = state.fast.q;
        let range = (within(-most, demand.i_q), within(most, demand.i_q));
        let excess = i_q - within(i_q, range);
        let ramp = if demand.quick { self.quick_ramp } else { self.ramp };
        let step = limited(demand.freq - state.rotor_freq, ramp);
        // The less q-axis current is left, the smaller is the acceleration.
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

    /// Returns the voltage of a rotating motor.
    fn turn(&self, state: &mut VoltsPerHertzState, demand: &Demand) -> Result<Dq, Fault> {
        self.follow(state, demand)?;
        let room = (self.reactive_a - state.slow.d) * (5.0 / self.reactive_a);
        let flux = state.flux + limited(room, 1.0) * (PERIOD_S / TRIM_S);
        state.flux = within(flux, (LEAST_FLUX, 1.0));
        let whole = self.volts * state.freq;
        // The voltage across the resistance has priority.
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

    /// Checks by the current that rotates backwards that all three phases carry current.
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

/// Checks that a voltage along phase a causes a current along phase a.
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

    /// Tests the result for a voltage along phase a, by the direction of the current in degrees.
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

    /// A motor is stalled if it is at its limit below 4 Hz for two seconds, or for longer at more than a fifth of the time.
    #[cfg_attr(not(feature = "vf"), ignore)]
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

    /// The fault needs more than 0.4 of the current to rotate backwards for half a second, at 8 Hz or above without interruption.
    #[cfg_attr(not(feature = "vf"), ignore)]
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
