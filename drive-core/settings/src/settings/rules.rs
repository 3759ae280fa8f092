//! The rules: settings that follow from the nameplate, the motor, the sensors' range and the dc link, unless they are
//! set.
//!
//! Each rule scales a number that was tried on the dissertation's motor and board in proportion to the quantity on which it
//! depends. For that motor the rules return these numbers. With `sequence.flux` high, the current limit and the d-axis current
//! follow from the torque instead: [`Settings::current_limit_a`], [`Settings::i_d`].
//!
//! | setting | on the dissertation's motor | in proportion to |
//! |---|---|---|
//! | `limits.trip_a` | 4.3 A | the sensors' range; at most 2.2 times the rated current |
//! | `limits.current_a` | 3.5 A | rated current; at most 0.814 of the trip |
//! | `speed.i_q_limit_a` | 3 A | `limits.current_a` |
//! | `sequence.i_d` | 0.7 A | rated current |
//! | `limits.motor_a` | 3.62 A | rated current |
//! | `limits.inverter_a` | 3.5 A | `limits.current_a` |
//! | `sequence.stop_a_per_s` | 30 A/s | rated current |
//! | `sequence.magnetise_s` | 0.93 s | rotor time constant: five of them, 0.8 s at least |
//! | `inverter.full_compensation_a` | 30 mA | the sensors' range |
//! | `injection.amplitude_v` | 50 V | see [`Settings::carrier_v`] |
//! | `injection.full_reference_iq_a` | 1 A | rated current |
//! | `injection.current_saliency` | 0.0338 1/A | inverse of the rated current |
//! | `injection.tracked_rpm` | 700 rpm | inverse of the pole pairs |
//! | `speed.limit_rpm` | 1720 rpm with the observer | rated speed; at most 0.998 of `limits.speed_rpm` |
//! | `speed.limit_rpm` without it | 300 rpm | inverse of the pole pairs |
//! | `speed.ramp_rpm_per_s` | 300 rpm/s | rated speed, which the ramp reaches after 5.7 s |
//! | `speed.quick_rpm_per_s` | 900 rpm/s | `speed.ramp_rpm_per_s` |
//! | `limits.speed_rpm` | 2000 rpm | rated speed |
//! | `current_plant.d`, `.q` | Eq. 3.41, 3.42 | the plants computed from the parameters |
//! | `limits.dc_over_v`, `limits.dc_under_v` | 400 V, 200 V | nominal dc link; at most 0.95 of the sensor's range, and the board's limit |
//! | `braking.high_v`, `braking.low_v` | 390 V, 260 V | nominal dc link; between the trip voltages |
//! | `braking.flux_a` | 1 A | rated current; at most 0.998 of `limits.current_a` |
//! | `limits.unexplained_v` | 12 V | see [`Settings::unexplained_v`] |
//! | `motor.inertia` | 0.0051 kg m2 | rated torque over rated speed: see [`Settings::inertia`] |
//! | `vf.volts_per_hz` | 6.333 V/Hz | rated voltage and frequency |
//! | `vf.boost_a` | 1.629 A | rated current; at most 0.6 of `limits.current_a` |

pub mod dc_link;

use core::f32::consts::{FRAC_1_SQRT_2, SQRT_2, TAU};

use super::list::RATED_A;
use super::numbers::{TRIP_OF_RANGE, WITHIN, either_sign, or_rule};
use super::{CurrentSensors, Flux, IdentifiedPlant, InjectionAxis, Inverter, Nameplate, Settings};
use crate::tuning::motor_plant;
use drive_core::printed::DemodulatorKind;
use drive_core::table::{CarrierTable, Grid, ReferenceTable, SlopeTable};
use drive_core::{AngleSource, CONVERTER_CODES, FirstOrder, Line, Motor, PERIOD_S, SQRT_3};

/// Injection current per d-axis current.
const CARRIER_OF_I_D: f32 = 0.368_07;
/// Largest injection current, as a share of the difference between the trip and the current limit. The rest is for
/// noise and overshoot.
const CARRIER_OF_ROOM: f32 = 0.75;
/// Torque at the current limit with high flux, as a share of the rated torque. Frequency converters give 150 % for a minute; the
/// rest is for the angle error and a warmer motor.
const OVERLOAD: f32 = 1.55;
/// Largest current limit with high flux, in rated currents, so that a circuit that needs more does not overload motor and inverter.
const LIMIT_OF_RATED: f32 = 1.6;
/// Current limit per trip current with high flux. The rest is for the injection, whose current grows by 14 % and more as
/// the leakage saturates, for the noise, and for the overshoot of a step. (0.814 tripped in 27 of 36 self-commissionings
/// of motors that saturate.)
const LIMIT_OF_TRIP: f32 = 0.76;
/// Time in which the rated torque accelerates the assumed inertia to the rated speed, s. Rotors of 0.2 to 20 kW alone take 0.1 to
/// 0.2 s. With the inertia of a load besides, the speed loop is slower than it could be, but stable.
const ASSUMED_RUN_UP_S: f32 = 0.15;
/// Smallest and largest stator frequency above which the observer gives the angle, Hz, and that frequency per slip at the current
/// limit. Beyond the slip, 0.3 of it are left for a shaft that turns slowly.
const OBSERVER_LEADS_HZ: (f32, f32) = (16.0, 40.0);
const OBSERVER_LEADS_OF_SLIP: f32 = 1.3;
/// Peak of the phase voltage per voltage between lines, rms: the root of 2/3.
pub(crate) const PEAK_OF_PHASE: f32 = 0.816_496_6;
/// Injection frequency, Hz.
pub const CARRIER_HZ: f32 = 600.0;

/// Returns the q-axis current, A, that a current limit, A, leaves beside the d-axis current `i_d`, A.
fn remaining_a(i_d: f32, limit_a: f32) -> f32 {
    libm::sqrtf((limit_a * limit_a - i_d * i_d).max(0.0))
}

/// Quantities to which the rules are proportional.
impl Settings {
    /// Returns the rated current, A peak.
    pub fn rated_a(&self) -> f32 {
        SQRT_2 * self.nameplate.current_a
    }

    /// Returns a current in proportion to the rated current, which is `on_reference`, A, for the dissertation's motor.
    pub fn share_of_rated(&self, on_reference: f32) -> f32 {
        on_reference / RATED_A * self.rated_a()
    }

    /// Returns a current in proportion to the sensors' range, which is `on_reference`, A, with the dissertation's
    /// sensors. It is meant for thresholds above noise and ADC steps.
    pub fn share_of_range(&self, on_reference: f32) -> f32 {
        on_reference / -Line::CHANNEL_A.offset * self.sensor_range_a()
    }

    /// Returns a voltage in proportion to the dc link, which is `on_reference`, V, with the dissertation's inverter.
    /// It is meant for effects of the inverter voltage error.
    pub fn share_of_dc_link(&self, on_reference: f32) -> f32 {
        on_reference / Inverter::DEFAULT.dc_link_v * self.inverter.dc_link_v
    }

    /// Returns the inertia of rotor and load, kg m². Until it is measured (`commission inertia`) or set, it is assumed: the rated
    /// torque takes 0.15 s to the rated speed.
    pub fn inertia(&self) -> f32 {
        or_rule(self, self.inertia, |s| {
            let rated = s.nameplate.speed_rpm * TAU / 60.0;
            ASSUMED_RUN_UP_S * s.nameplate.torque_nm() / rated
        })
    }

    /// Returns the mechanical speed at the same electrical frequency as `on_reference` with the dissertation's pole pairs.
    pub(super) fn share_of_poles(&self, on_reference: f32) -> f32 {
        on_reference * f32::from(Motor::DEFAULT.pole_pairs) / f32::from(self.motor.pole_pairs)
    }

    /// Returns the largest phase current that all sensors can measure in both directions, A.
    pub fn sensor_range_a(&self) -> f32 {
        let s = &self.scales;
        let end = |line: Line| {
            // With a negative gain, the positive end is at 0 ADC counts.
            let (zero, full) = (line.offset, line.at(s.full_scale));
            if line.gain < 0.0 { f32::min(zero, -full) } else { f32::min(-zero, full) }
        };
        let both = f32::min(end(s.current_a), end(s.current_b));
        match s.sensors {
            CurrentSensors::InLine => both,
            CurrentSensors::LowSide => f32::min(both, end(s.current_c)),
        }
    }

    /// Returns the largest dc link that the ADC can measure, V.
    pub fn dc_link_range_v(&self) -> f32 {
        self.scales.dc_link.at(CONVERTER_CODES)
    }

    /// Returns the speed above which the drive trips, rpm: the limit of the shaft, or the end of the range in which the
    /// injection alone tracks the angle.
    pub fn highest_rpm(&self) -> f32 {
        let alone = self.tracks_synchronously() && !self.uses_observer();
        let tracked = if alone { self.tracked_rpm() } else { f32::INFINITY };
        f32::min(tracked, self.speed_trip_rpm())
    }

    /// Converts a mechanical speed, rpm, to electrical turns per control period.
    pub(crate) fn freq_of_rpm(&self, rpm: f32) -> f32 {
        rpm / 60.0 * f32::from(self.motor.pole_pairs) * PERIOD_S
    }

    /// Whether the angle comes from the synchronous demodulation, whose saliency the drive can learn.
    pub fn tracks_synchronously(&self) -> bool {
        self.angle_source == AngleSource::Injection
            && self.injection.demodulator == DemodulatorKind::Synchronous
    }

    /// Whether the lock monitor runs.
    pub(crate) fn watches_lock(&self) -> bool {
        self.tracks_synchronously() && self.injection.synchronous.monitor
    }

    /// Whether the back-EMF observer takes over from the injection at speed.
    pub(crate) fn uses_observer(&self) -> bool {
        self.tracks_synchronously() && self.observer.enabled
    }

    /// Returns the stator frequency above which the back-EMF observer gives the angle, Hz: at least 16 Hz, and above the slip at the
    /// current limit, so that a shaft that stands is left to the injection under any torque. Up to 40 Hz the sixth harmonic of the
    /// dead time stays below half of the injection frequency until the injection is switched off.
    pub(crate) fn observer_leads_hz(&self) -> f32 {
        (OBSERVER_LEADS_OF_SLIP / TAU * self.largest_slip())
            .clamp(OBSERVER_LEADS_HZ.0, OBSERVER_LEADS_HZ.1)
    }

    /// Returns the slip at the current limit, rad/s.
    pub(crate) fn largest_slip(&self) -> f32 {
        let i_d = self.i_d();
        remaining_a(i_d, self.current_limit_a()) / (self.motor.tau_r() * i_d)
    }
}

impl Nameplate {
    /// Returns the rated torque, Nm: power over speed.
    pub fn torque_nm(&self) -> f32 {
        self.power_w / (self.speed_rpm * TAU / 60.0)
    }

    /// Returns the rated flux, Vs peak: the voltage of a phase over the rated frequency.
    pub(crate) fn flux(&self) -> f32 {
        self.voltage_v * PEAK_OF_PHASE / (TAU * self.frequency_hz)
    }

    /// Returns the base impedance of a phase, ohm.
    pub fn base_impedance(&self) -> f32 {
        self.voltage_v / (SQRT_3 * self.current_a)
    }

    /// Returns the number of pole pairs: the largest one whose synchronous speed is not below the rated speed. A speed that is up to 0.02 of
    /// a pole pair too high counts as synchronous, because some nameplates show no slip.
    pub fn pole_pairs(&self) -> u8 {
        (60.0 * self.frequency_hz / self.speed_rpm + 0.02).max(1.0) as u8
    }

    /// Returns the slip at rated speed.
    pub fn slip(&self) -> f32 {
        1.0 - self.speed_rpm * f32::from(self.pole_pairs()) / (60.0 * self.frequency_hz)
    }
}

/// Rules and ranges that are longer than a line.
impl Settings {
    /// Returns the range of the offset. Zero current lies between 5 % and 95 % of the ADC counts, so that currents of both signs
    /// can be measured.
    pub(super) fn offset_range(&self, line: Line) -> (f32, f32) {
        let full = line.gain.abs() * f32::from(self.scales.full_scale);
        either_sign(-line.gain, 0.05 * full, 0.95 * full)
    }

    /// Returns `sequence.i_d` by its rule.
    pub(super) fn i_d_rule(&self) -> f32 {
        match self.sequence.flux {
            Flux::Low => f32::min(self.share_of_rated(0.7), WITHIN * self.current_limit_a()),
            Flux::High => self.useful_i_d(self.current_limit_a()),
        }
    }

    /// Returns the best d-axis current with a current limit, A: the current of the rated flux, at most the current of the
    /// largest torque at the rated current and at the limit. Torque is proportional to i_d i_q, which is largest if both are
    /// equal.
    fn useful_i_d(&self, limit_a: f32) -> f32 {
        f32::min(self.nameplate.flux() / self.motor.l_m, self.largest_i_d(limit_a))
    }

    /// Returns the largest magnetising current with a current limit, A: the current of the largest torque at the rated current and
    /// at the limit.
    pub fn largest_i_d(&self, limit_a: f32) -> f32 {
        FRAC_1_SQRT_2 * self.rated_a().min(limit_a)
    }

    /// Returns the current limit per trip current.
    pub(super) fn limit_of_trip(&self) -> f32 {
        match self.sequence.flux {
            Flux::Low => 0.814,
            Flux::High => LIMIT_OF_TRIP,
        }
    }

    /// Returns the current limit by rule, A, if the trip allows it. It is at least the rated current, which the tests of the
    /// commissioning need while the motor is unknown.
    pub(super) fn wanted_limit_a(&self) -> f32 {
        match self.sequence.flux {
            Flux::Low => self.share_of_rated(3.5),
            Flux::High => {
                let i_d = self.useful_i_d(f32::INFINITY);
                let i_q = OVERLOAD * self.nameplate.torque_nm() / self.motor.torque_per_ampere(i_d);
                libm::hypotf(i_d, i_q).clamp(self.rated_a(), LIMIT_OF_RATED * self.rated_a())
            }
        }
    }

    /// Returns the torque at rest, % of the rated torque, for a d-axis current, A, and the q-axis current that a current limit, A,
    /// leaves.
    pub fn torque_pct(&self, i_d: f32, limit_a: f32) -> f32 {
        let i_q = remaining_a(i_d, limit_a);
        100.0 * self.motor.torque_per_ampere(i_d) * i_q / self.nameplate.torque_nm()
    }

    /// Returns the range of current sensors, A, that would not be the limiting factor, and the torque at rest that it allows, % of the
    /// rated torque; none if the present range does not limit the current.
    pub fn better_sensors(&self) -> Option<(f32, f32)> {
        let (limits, wanted) = (&self.limits, self.wanted_limit_a());
        let by_rule = limits.current_a.is_none() && limits.trip_a.is_none();
        let i_d = self.sequence.i_d.unwrap_or_else(|| match self.sequence.flux {
            Flux::Low => self.i_d(),
            Flux::High => self.useful_i_d(wanted),
        });
        let range_a = wanted / self.limit_of_trip() / TRIP_OF_RANGE;
        (by_rule && range_a > 1.001 * self.sensor_range_a())
            .then(|| (range_a, self.torque_pct(i_d, wanted)))
    }

    /// Returns the q-axis currents of the tables. With the dissertation's flux they go up to the current limit; otherwise up to the
    /// current that the limit leaves beside the d-axis current, so that the last point is the largest torque.
    pub fn grid(&self) -> Grid {
        let (limit, i_d) = (self.current_limit_a(), self.i_d());
        Grid::for_current(match self.sequence.flux {
            Flux::Low => limit,
            Flux::High => libm::sqrtf((limit * limit - i_d * i_d).max(f32::MIN_POSITIVE)),
        })
    }

    /// Returns `injection.amplitude_v` by its rule, which the setting explains.
    pub(super) fn carrier_rule(&self) -> f32 {
        let reactance = self.carrier_reactance();
        let of_i_d = CARRIER_OF_I_D * self.i_d();
        let by_noise = f32::min(of_i_d, self.share_of_rated(0.463)) * reactance;
        let of_link = self.share_of_dc_link(50.0);
        let wanted = f32::max(by_noise, of_link);
        let room = CARRIER_OF_ROOM * (self.trip_a() - self.current_limit_a());
        let most = f32::min(f32::max(0.5 * self.i_d() * reactance, of_link), room * reactance);
        let sensed =
            f32::min(wanted, most).clamp(self.share_of_dc_link(20.0), self.share_of_dc_link(110.0));
        let nm = WITHIN / 100.0 * self.injection.torque_pct * self.nameplate.torque_nm();
        let shaking = nm / self.motor.torque_per_ampere(self.i_d()) * reactance;
        let shaking = shaking.max(self.share_of_dc_link(35.0));
        if self.injection.axis == InjectionAxis::Q { sensed.min(shaking) } else { sensed }
    }

    fn carrier_reactance(&self) -> f32 {
        TAU * CARRIER_HZ * self.motor.sigma_l_s()
    }

    /// Returns the amplitude of the injection current at the full injection voltage, A. Resistances are neglected: they make it less than 2 %
    /// smaller.
    pub fn injection_a(&self) -> f32 {
        self.carrier_v() / self.carrier_reactance()
    }

    /// Returns the amplitude of the torque that the injection current causes at 600 Hz, Nm. The rotor flux is constant during an injection
    /// period, because the rotor time constant is much longer. On the d axis, the part of the current across the flux makes the torque; it
    /// follows from the saliency offset `offset` and is that at rated torque.
    pub fn injection_nm(&self, offset: &ReferenceTable) -> f32 {
        let per_ampere = self.motor.torque_per_ampere(self.i_d());
        let turned = offset.at(self.nameplate.torque_nm() / per_ampere).abs();
        let across = if self.injection.axis == InjectionAxis::Q { 1.0 } else { turned };
        per_ampere * self.injection_a() * across
    }

    /// Returns the plant of the d axis for the design of its current controller. The rule is the plant that was identified
    /// on the dissertation's motor (Eq. 3.41). The gain and the distance of the pole from 1 are scaled in proportion to
    /// those of the plants computed from the parameters.
    pub fn identified_d(&self) -> FirstOrder {
        self.identified(&self.current_plant.d, FirstOrder { k: 0.002_837, p: 0.9511 })
    }

    /// Returns the plant of the q axis by the same rule (Eq. 3.42).
    pub fn identified_q(&self) -> FirstOrder {
        self.identified(&self.current_plant.q, FirstOrder { k: 0.003_721, p: 0.9503 })
    }

    fn identified(&self, set: &IdentifiedPlant, on_reference: FirstOrder) -> FirstOrder {
        let computed = |motor: &Motor| motor_plant(&(*motor).into(), f64::from(PERIOD_S));
        let rule = match (computed(&self.motor), computed(&Motor::DEFAULT)) {
            (Ok(own), Ok(reference)) => {
                let p = 1.0 - (1.0 - on_reference.p) * ((1.0 - own.p) / (1.0 - reference.p));
                // If the leakage is too small for a pole, the design of the controllers refuses its time constant.
                FirstOrder { k: on_reference.k * (own.k / reference.k), p: p.max(f64::EPSILON) }
            }
            // The parameters are outside their ranges, which the check of the settings reports.
            _ => on_reference,
        };
        FirstOrder { k: set.k.map_or(rule.k, f64::from), p: set.p.map_or(rule.p, f64::from) }
    }

    /// Returns the saliency offset over the q-axis current.
    pub fn reference(&self) -> ReferenceTable {
        let guess = || ReferenceTable::guessed(self.grid());
        self.injection.synchronous.reference.unwrap_or_else(guess)
    }

    /// Returns the saliency sensitivity that is used until it is learned, which is that of a saliency fixed to the flux alone.
    pub fn slope(&self) -> SlopeTable {
        let grid = self.reference().grid();
        SlopeTable::of_flux_saliency(grid, self.injection.synchronous.flux_saliency)
    }

    /// Returns the injection current over the q-axis current.
    pub fn carrier(&self) -> CarrierTable {
        let guess = || {
            let (guessed, sign) = (CarrierTable::guessed(self.grid()), self.injection.axis.sign());
            let points = guessed.points().map(|ratio| 1.0 + sign * (ratio - 1.0));
            CarrierTable::from_points(guessed.grid(), points).unwrap_or(guessed)
        };
        self.injection.synchronous.carrier.unwrap_or_else(guess)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f32, expected: f32) {
        assert!((value / expected - 1.0).abs() < 1e-3, "{value}, not {expected}");
    }

    /// The rules return the numbers that the drive had before it had rules.
    #[test]
    fn the_rules_give_the_numbers_of_the_dissertations_motor() {
        let s = Settings::default();
        for (value, expected) in [
            (s.trip_a(), 4.3),
            (s.current_limit_a(), 3.5),
            (s.i_q_limit_a(), 3.0),
            (s.i_d(), 0.7),
            (s.stop_a_per_s(), 30.0),
            (s.full_compensation_a(), 0.03),
            (s.carrier_v(), 50.0),
            (s.full_reference_iq_a(), 1.0),
            (s.current_saliency(), 0.0338),
            (s.tracked_rpm(), 700.0),
            (s.speed_limit_rpm(), 1720.0),
            (s.ramp_rpm_per_s(), 300.0),
            (s.quick_rpm_per_s(), 900.0),
            (s.speed_trip_rpm(), 2000.0),
            (s.dc_over_v(), 400.0),
            (s.dc_under_v(), 200.0),
            (s.unexplained_v(), 12.0),
        ] {
            near(value, expected);
        }
        near(s.magnetise_s(), 5.0 * 0.186_09);
    }

    /// The slip at the limit of the dissertation's motor is 4.2 Hz. A twelfth of its rotor time constant gives 50 Hz.
    #[test]
    fn the_observer_leads_above_the_slip_at_the_limit() {
        let mut s = Settings::default();
        for (share, expected) in [(1.0, 16.0), (0.25, 21.8), (0.2, 27.23), (1.0 / 12.0, 40.0)] {
            s.motor.r_r = Settings::default().motor.r_r / share;
            near(s.observer_leads_hz(), expected);
        }
    }

    /// For a motor of twice the voltage and half the current, and for a motor of the same voltage and twice the
    /// current, the thresholds are in proportion to those of the reference.
    #[test]
    fn the_rules_scale_with_the_motor() {
        let mut s = Settings::default();
        let scaled = |s: &mut Settings, volts: f32, amperes: f32| {
            let impedance = volts / amperes;
            for z in [&mut s.motor.r_s, &mut s.motor.r_r] {
                *z *= impedance;
            }
            for z in [&mut s.motor.l_ls, &mut s.motor.l_lr, &mut s.motor.l_m] {
                *z *= impedance;
            }
            s.nameplate.current_a *= amperes;
            s.inverter.dc_link_v *= volts;
            s.scales.dc_link = s.scales.dc_link.scaled(volts);
            s.scales.current_a = s.scales.current_a.scaled(amperes);
            s.scales.current_b = s.scales.current_b.scaled(amperes);
        };
        scaled(&mut s, 0.154, 20.0);
        near(s.trip_a(), 86.0);
        near(s.current_limit_a(), 70.0);
        near(s.i_d(), 14.0);
        near(s.carrier_v(), 7.7);
        near(s.dc_over_v(), 61.6);
        near(s.unexplained_v(), 1.848);
        near(s.magnetise_s(), 5.0 * 0.186_09);
        assert!(s.check().is_ok());
    }

    /// Rules that follow from a limit that is set stay within it, with any number of digits.
    #[test]
    fn rules_stay_within_the_limits_that_are_set() {
        for amperes in [0.9, 0.123_456, 0.123_444] {
            let mut s = Settings::default();
            s.limits.current_a = Some(amperes);
            assert_eq!(s.check(), Ok(()), "{amperes}");
        }
        for (rpm, observer) in [(1000.0, true), (1234.56, true), (200.0, false), (300.02, false)] {
            let mut s = Settings::default();
            (s.limits.speed_rpm, s.observer.enabled) = (Some(rpm), observer);
            assert_eq!(s.check(), Ok(()), "{rpm}");
        }
    }

    /// A rule whose value is zero has no digits to round to.
    #[test]
    fn a_rule_of_zero_is_zero() {
        let mut s = Settings::default();
        s.limits.heat_sink_c = 15.0;
        assert_eq!(s.derate_c(), 0.0);
        assert_eq!(s.check(), Ok(()));
    }

    /// 1.5 kW at 1435 rpm are 9.982 Nm. With 3/2 P L_m^2/L_r = 0.951 H and the 3.15 A of the rated flux, 155 % of that torque needs 5.164
    /// A. Sensors of 6 A trip at 5.768 A. The current limit is 0.76 of that, and each axis has 0.707 of the limit: 0.951 * 3.1^2 Nm.
    #[test]
    fn with_high_flux_the_torque_decides() {
        let mut s = Settings::default();
        s.nameplate = Nameplate {
            power_w: 1500.0,
            voltage_v: 400.0,
            current_a: 3.4,
            frequency_hz: 50.0,
            speed_rpm: 1435.0,
        };
        s.motor = Motor { r_s: 4.6, r_r: 3.3, l_ls: 0.0135, l_lr: 0.0135, l_m: 0.33, ..s.motor };
        s.inverter.dc_link_v = 560.0;
        s.scales.dc_link = s.scales.dc_link.scaled(1.8);
        s.sequence.flux = Flux::High;
        let sensors = |range_a: f32| {
            let mut s = s;
            for line in [&mut s.scales.current_a, &mut s.scales.current_b] {
                *line = line.scaled(range_a / 4.472_713);
            }
            assert_eq!(s.check(), Ok(()));
            s
        };
        let fit = sensors(12.0);
        near(fit.trip_a(), 10.58);
        near(fit.current_limit_a(), 6.049);
        near(fit.i_d(), 3.15);
        near(fit.grid().current(14), 5.164);
        near(fit.torque_pct(fit.i_d(), fit.current_limit_a()), 155.0);
        assert_eq!(fit.better_sensors(), None);
        let small = sensors(6.0);
        near(small.trip_a(), 5.768);
        near(small.current_limit_a(), 4.384);
        near(small.i_d(), 3.1);
        near(small.torque_pct(small.i_d(), small.current_limit_a()), 91.6);
        let (range_a, pct) = small.better_sensors().unwrap();
        near(range_a, 8.279);
        near(pct, 155.0);
        // Sensors of that range are not the limiting factor.
        near(sensors(range_a).current_limit_a(), 6.049);
        // No d-axis current gives the rated torque with the dissertation's circuit: at the rated current, equal currents of both
        // axes give the largest torque.
        let mut own = Settings::default();
        own.sequence.flux = Flux::High;
        near(own.i_d(), core::f32::consts::FRAC_1_SQRT_2 * own.current_limit_a());
        near(own.current_limit_a(), 0.76 * own.trip_a());
    }

    #[test]
    fn small_sensors_lower_the_limits() {
        let mut s = Settings::default();
        s.nameplate.current_a *= 10.0;
        near(s.trip_a(), 0.9614 * 4.472_713);
        near(s.current_limit_a(), 0.814 * s.trip_a());
    }
}
