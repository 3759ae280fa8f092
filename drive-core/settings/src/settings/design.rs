//! Design of the coefficients of the control step.

mod estimator;
mod flying_start;
pub(crate) mod learning;
pub(crate) mod saliency_check;
mod scalar;

use core::f32::consts::TAU;

use crate::settings::{CurrentSensors, InjectionAxis, PlantSource, Settings, SettingsError};
use crate::tuning::{self, CurrentLoopDesign, MotionDesign, SpeedSource, TuningError};
use drive_core::carrier::{AtStart, CARRIER_S, Injection};
use drive_core::current::{DeadTime, DqPi, InverterDrop, Modulator, Pi, VoltageLimit};
use drive_core::flux::{AngleLoop, Indirect, Leakage, Observer};
use drive_core::printed::DemodulatorKind;
use drive_core::protect::{
    Body, LockMonitor, NoiseWatch, OffsetCheck, Prediction, Thermal, TravelWatch, WiringCheck,
    WiringSettings,
};
use drive_core::{
    Angle, AngleSource, Coefficients, DcLink, FirstOrder, FrontEnd, Learning, Motion, PERIOD_S,
    Protection, Ramps, SequenceSteps, Shunts, UnitVector, periods,
};

/// Time for which the lock is verified, s: the tracking loop settles in a third of it.
const VERIFY_S: f32 = 0.3;
/// Rated frequency, Hz, up to which a shaft below 1 Hz (30 rpm of four poles) counts as standing; above it the limit grows in proportion.
/// An angle error of a few degrees turns a free shaft.
const STANDING_OF_HZ: f32 = 60.0;
/// Angle error, rad, whose torque may push a free shaft while the lock is verified. A false lock pushes it ten times as hard.
const PUSHING_ERROR: f32 = 0.1;
/// Rotor time constants for which the flux decays before the asymmetry is measured. The saliency, which is proportional to the
/// square of the flux, decays to 0.25 %.
const DECAY_T: f32 = 3.0;
/// Time between two steps of the thermal loads, s.
const THERMAL_S: f32 = Thermal::EVERY as f32 * PERIOD_S;
/// Allowed mean of the unexplained voltage in the flux frame, as a share of the allowed unexplained voltage: 6 V with
/// the dissertation's motor, and 3 V with the observer, which tracks the stator resistance.
const UNEXPLAINED_MEAN: [f32; 2] = [0.5, 0.25];
/// Change of the q-axis current in an injection period above which the lock monitor pauses, with the dissertation's motor,
/// A: 18 A/s.
const MOVED_A: f32 = 0.03;
/// Minimum injection current as a share of the expected one. With an open phase the injection current is
/// reduced by the squared cosine of the angle between the injection axis and the remaining current axis.
const LEAST_CARRIER: f32 = 0.5;
/// Largest accepted offset of a current sensor with the dissertation's sensors, A.
const LARGEST_OFFSET_A: f32 = 0.2;
/// Largest mean sum of the three phase currents with the dissertation's sensors, A: 7 % of the range.
const LARGEST_SUM_A: f32 = 0.3;
/// Sampling time of the ADCs, s, rounded up. The shunts must be connected for this time before the sample, and for the
/// same time after it for the third current.
const SHUNT_SAMPLING_S: f32 = 1e-6;
/// Peak current of the pulses of the wiring check with the dissertation's motor, A.
const WIRING_A: f32 = 0.2;
/// Margin of the wiring check for noise with the dissertation's sensors, A.
const WIRING_NOISE_A: f32 = 0.05;
/// Largest voltage of the pulses of the wiring check, V, and largest test voltage of an axis, with 311 V.
const LARGEST_TEST_V: f32 = 60.0;

impl Settings {
    /// Checks every value and runs the design rules.
    ///
    /// # Errors
    /// The first value outside its range, by name, with the range; or the reason why a design rule
    /// cannot be met.
    pub fn build(&self) -> Result<Coefficients, SettingsError> {
        self.build_for_loop()
    }

    /// As [`build`](Self::build), for a drive with any loop.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_for_loop<L: AngleLoop>(&self) -> Result<Coefficients<L>, SettingsError> {
        self.check()?;
        let m = &self.motor;
        let motor_plant = self.motor_plant()?;
        let designs = self.current_loops()?;
        let [d, q] = designs.map(|d| Pi { k_c: d.k_c as f32, z_c: d.z_c as f32 });
        let motion_design = self.motion_loops()?;

        let (inj, t) = (&self.injection, &self.injection.synchronous);
        let (i_d, current_limit) = (self.i_d(), self.current_limit_a());
        let (carrier_v, allowed_v) = (self.carrier_v(), self.unexplained_v());
        let allowed_mean_v = UNEXPLAINED_MEAN.map(|share| share * allowed_v);
        let tracks = self.tracks_synchronously();
        let injecting = self.angle_source == AngleSource::Injection || inj.beside_encoder;
        let s = &self.scales;
        let current_lag = self.current_age_s() / PERIOD_S;
        let carrier_lag = current_lag + estimator::carrier_lag(motor_plant);
        let trip_freq = self.freq_of_rpm(self.speed_trip_rpm());
        let lag_share = if self.ignore_delays { 0.0 } else { 1.0 };
        let injection = Injection::new(carrier_v, motor_plant, current_lag);
        let carrier_a = injection.current_amplitude;
        let along_flux = inj.axis == InjectionAxis::D || inj.demodulator.is_along_flux();
        let (injection_turn, injection_axis) = if along_flux {
            (Angle::ZERO, UnitVector { cos: 1.0, sin: 0.0 })
        } else {
            (Angle::QUARTER, UnitVector { cos: 0.0, sin: 1.0 })
        };
        let shunts = self.shunts();
        let limit = VoltageLimit::new(m, i_d, current_limit);
        let largest_test_v = self.share_of_dc_link(LARGEST_TEST_V);
        let (dead_time_s, carrier_s) = (self.inverter.dead_time_s, self.inverter.carrier_s());
        let dead_time = DeadTime::new(dead_time_s, carrier_s, self.full_compensation_a());
        // The pulses have twice the voltage error of the dead time, over the two periods of the shortest pulse.
        let pulse_vs = 4.0 * PERIOD_S * dead_time_s / carrier_s * self.inverter.dc_link_v;
        let leakage = Leakage {
            flux_saliency: 0.5 * self.slope().at_rest(),
            current_saliency: self.current_saliency(),
            share: self.observer.leakage_share,
            slope: self.observer.leakage_slope,
        };
        let standing_freq = PERIOD_S * (self.nameplate.frequency_hz / STANDING_OF_HZ).max(1.0);
        let torque = m.torque_per_ampere(i_d) * PUSHING_ERROR * i_d;
        let pushed_freq = self.freq_of_rpm(60.0 / TAU * torque / self.inertia() * VERIFY_S);
        Ok(Coefficients {
            front_end: FrontEnd {
                current_a: s.of_code(s.current_a),
                current_b: s.of_code(s.current_b),
                both_zero_vectors: s.both_zero_vectors,
                shunts,
                dc_link: s.dc_link,
                full_scale: s.full_scale.saturating_mul(1 + u16::from(s.both_zero_vectors)),
                heat_sink: s.ntc.checks(self.derate_c(), self.limits.heat_sink_c),
                top: f32::from(self.inverter.top / self.inverter.switching_khz.pulses()),
            },
            offsets: OffsetCheck {
                samples: periods(self.sequence.calibrate_s) as u16,
                largest: self.share_of_range(LARGEST_OFFSET_A),
                shunts: self.scales.sensors == CurrentSensors::LowSide,
            },
            source: self.angle_source,
            track_rotor: self.track_rotor,
            indirect: Indirect::new(m, s.encoder_counts, i_d, 2.0 * self.speed_trip_rpm() / 60.0),
            inject: injecting && carrier_v > 0.0,
            demodulate: injecting,
            injection,
            injection_turn,
            injection_axis,
            lock_monitor: self.watches_lock().then(|| self.lock_monitor(carrier_a)),
            // Only a sensorless start with the synchronous demodulation is checked.
            saliency_check: (t.check && tracks)
                .then(|| saliency_check::design(t.flux_saliency, m.tau_r())),
            noise_watch: (self.angle_source == AngleSource::Injection).then(|| {
                NoiseWatch::new(t.flux_saliency, carrier_a, self.share_of_range(estimator::NOISE_A))
            }),
            travel_watch: TravelWatch::new(self.share_of_range(1.0)),
            at_start: tracks
                .then(|| AtStart { decay: periods(DECAY_T * m.tau_r()), learned: None }),
            wiring: WiringCheck::new(&WiringSettings {
                sigma_ls: m.sigma_l_s(),
                expected_a: self.share_of_rated(WIRING_A).max(pulse_vs / m.sigma_l_s()),
                noise_a: self.share_of_range(WIRING_NOISE_A),
                highest_v: largest_test_v,
            }),
            largest_test_v,
            estimator: self.estimator(lag_share, carrier_lag, trip_freq, (carrier_v, carrier_a)),
            current_loop: DqPi { d, q },
            current_lag,
            lag_share,
            modulator: Modulator::new(dead_time_s, carrier_s, self.inverter.compensate)
                .readable(shunts.map(|shunts| shunts.readable)),
            dead_time: if self.inverter.compensate { dead_time } else { DeadTime::NONE },
            inverter_drop: InverterDrop::new(m, i_d, self.magnetise_s(), current_limit)
                .known(self.inverter.drop_v),
            thermal: Thermal {
                motor: Body::new(self.motor_a(), self.limits.motor_s, THERMAL_S),
                inverter: Body::new(self.inverter_a(), self.limits.inverter_s, THERMAL_S),
            },
            relay: self.relay(),
            volts_per_hertz: self.volts_per_hertz(),
            learning: self.learning(),
            motor_c: self.motor_sensor.limits(),
            unlearned: tracks && !t.allow_unlearned,
            prediction: Prediction::new(m, motor_plant, allowed_v, allowed_mean_v),
            flying_start: self.flying_start([d.k_c, q.k_c]),
            voltage_limit: if self.flux.minimise_loss { limit.economical(m) } else { limit },
            dc_link: DcLink::new(&self.dc_link_limits()),
            power: self.power_limit(),
            motion: self.motion(&motion_design),
            freq_per_speed: self.freq_of_rpm(60.0),
            speed_per_freq: 1.0 / self.freq_of_rpm(60.0),
            protection: Protection {
                trip_a: self.trip_a(),
                dc_over: self.dc_over_v(),
                dc_under: self.dc_under_v(),
                rotor_freq: self.freq_of_rpm(self.highest_rpm()),
                i_q: current_limit,
            },
            observer: self.uses_observer().then(|| Observer::new(m, &leakage, i_d, current_lag)),
            observer_leads: self.observer_leads_hz() * PERIOD_S,
            sequence: SequenceSteps {
                precharge: periods(self.sequence.precharge_s),
                magnetise: periods(self.magnetise_s()),
                verify: periods(VERIFY_S),
                standing_freq,
                pushed_freq: standing_freq.max(pushed_freq),
                stop_ramp: self.stop_a_per_s() * PERIOD_S,
            },
        })
    }

    /// Returns the saliency self-commissioning with these settings, which must be [valid](Self::check).
    pub fn learning(&self) -> Learning {
        let synchronous = self.injection.demodulator == DemodulatorKind::Synchronous;
        let sign = synchronous.then(|| self.injection.axis.sign());
        learning::plan(&self.motor, self.i_d(), self.current_limit_a(), self.grid(), sign)
    }

    /// Returns the selection of the phases to be used, with three shunts.
    fn shunts(&self) -> Option<Shunts> {
        let s = &self.scales;
        let window_s = self.inverter.dead_time_s + s.shunt_settle_s + SHUNT_SAMPLING_S;
        let largest_sum = self.share_of_range(LARGEST_SUM_A);
        (s.sensors == CurrentSensors::LowSide)
            .then(|| Shunts::new(s.current_c, window_s, largest_sum))
    }

    /// Returns the lock monitor; `carrier_a` is the expected injection current along the injection axis, A peak.
    fn lock_monitor(&self, carrier_a: f32) -> LockMonitor {
        let (t, least) = (&self.injection.synchronous, LEAST_CARRIER * carrier_a);
        let mut monitor = LockMonitor {
            smoothing: CARRIER_S / (t.deficit_s + CARRIER_S),
            allowed: t.allowed_deficit,
            moved: self.share_of_rated(MOVED_A),
            least: least * least,
            ..LockMonitor::default()
        };
        monitor.take(&self.carrier(), &self.slope(), self.injection.axis.sign());
        monitor
    }

    fn motor_plant(&self) -> Result<FirstOrder, TuningError> {
        tuning::motor_plant(&self.motor.into(), f64::from(PERIOD_S))
    }

    /// Designs the current controllers, d and q, with valid settings.
    ///
    /// # Errors
    /// The design rule that cannot be met.
    pub fn current_loops(&self) -> Result<[CurrentLoopDesign; 2], TuningError> {
        let motor_plant = self.motor_plant()?;
        let (d, q) = match self.current_plant.source {
            PlantSource::Identified => (self.identified_d(), self.identified_q()),
            PlantSource::Motor => (motor_plant, motor_plant),
        };
        let design = |plant| tuning::design_current_loop(plant, motor_plant, f64::from(PERIOD_S));
        Ok([design(d)?, design(q)?])
    }

    /// Designs the speed loop and the position loop, with valid settings.
    ///
    /// # Errors
    /// The design rule that cannot be met.
    pub fn motion_loops(&self) -> Result<MotionDesign, TuningError> {
        let m = &self.motor;
        let acceleration = m.torque_per_ampere(self.i_d()) / self.inertia() / TAU;
        let design = |source, divider| {
            tuning::design_motion_loops(
                f64::from(acceleration),
                source,
                f64::from(self.speed.phase_margin_deg),
                f64::from(PERIOD_S) * f64::from(divider),
            )
        };
        if self.angle_source == AngleSource::Encoder {
            return design(SpeedSource::Encoder, Motion::DIVIDER);
        }
        let hz = f64::from(self.injection.synchronous.bandwidth_hz);
        let counted = design(SpeedSource::Tracking { hz }, Motion::DIVIDER)?;
        if !self.tracks_synchronously() {
            return Ok(counted);
        }
        let turns = TAU * f32::from(m.pole_pairs);
        let slip = f64::from(1.0 / (m.tau_r() * self.i_d() * turns));
        let leakage = f64::from(m.sigma_l_s() / (m.coupled_inductance() * self.i_d() * turns));
        let source = SpeedSource::Estimate { slip, leakage };
        let estimated = design(source, Motion::ESTIMATED)?;
        // With little flux and much slip the loop on the counted angle is the faster one.
        Ok(if estimated.gains.k_c > counted.gains.k_c { estimated } else { counted })
    }

    fn motion(&self, design: &MotionDesign) -> Motion {
        let counts = match self.angle_source {
            AngleSource::Encoder => self.scales.encoder_counts,
            AngleSource::Injection => Motion::COUNTS_PER_TURN * u32::from(self.motor.pole_pairs),
        };
        let limit = self.speed_limit_rpm() / 60.0;
        let ramps = Ramps {
            usual: self.ramp_rpm_per_s() / 60.0,
            quick: self.quick_rpm_per_s() / 60.0,
            rise_s: self.speed.s_ramp_s,
        };
        Motion::new(&design.gains, counts, limit, &ramps, self.i_q_limit_a())
    }
}
