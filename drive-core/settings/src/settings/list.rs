//! The settings: field, default, unit, range, rule, help, who may change it, whether learned values depend on it, and whether
//! the power stage is at stake. To add one, add a row; [`declare`](super::declare) says what a row is.
//!
//! Structures, defaults, console, saved record, checks, keys of the simulator and documentation come from this table. It is one
//! file although it is long, so that the settings stand in the order in which they are shown.
//!
//! A rule is a number that was tried on the dissertation's motor and board, in proportion to the quantity that it depends on;
//! see [`rules`](super::rules).

use core::f32::consts::SQRT_2;

use super::declare::{rule, settings};
use super::entry::{Access, Change, Entry, Guard, entry};
use super::numbers::{HIGH_OF_TRIP, LOW_OF_TRIP, MARGIN, TRIP_OF_RANGE, TRIP_OF_RATED, WITHIN};
use super::numbers::{either_sign, or_rule};
use super::value::Words;
use super::{Carrier, CurrentSensors, Flux, PlantSource, SensorKind};
use drive_core::carrier::DemodulatorKind;
use drive_core::table::{CarrierTable, ReferenceTable};
use drive_core::{AngleSource, DcLimit, Line, Motor, PERIOD_S};

/// Rated current of the dissertation's motor, A peak (Table 3, star).
pub(super) const RATED_A: f32 = Nameplate::DEFAULT.current_a * SQRT_2;
settings! {
    => [
        /// stator resistance of a phase
        "motor.r_s" [motor] r_s: f32, 0: number("ohm").from_to(1e-4, 1000.0).learned();
        /// rotor resistance, referred to the stator
        "motor.r_r" [motor] r_r: f32, 1: number("ohm").from_to(1e-4, 1000.0).learned();
        /// leakage inductance of the stator
        "motor.l_ls" [motor] l_ls: f32, 2: number("H").from_to(1e-7, 10.0).learned();
        /// leakage inductance of the rotor, referred to the stator
        "motor.l_lr" [motor] l_lr: f32, 3: number("H").from_to(1e-7, 10.0).learned();
        /// magnetising inductance
        "motor.l_m" [motor] l_m: f32, 4: number("H").from_to(1e-6, 1000.0).learned();
        /// pairs of poles
        "motor.pole_pairs" [motor] pole_pairs: u8, 5: whole().from_to(1.0, 6.0).learned();
        /// inertia of rotor and load; for the speed loop
        "motor.inertia" [motor] inertia: f32, 6: number("kg m2").from_to(1e-7, 1000.0);
    ];

    /// The temperature sensor of the motor, from ground to an input of the board, fed from the reference of the converter.
    MotorSensor "motor." [motor_sensor] {
        /// temperature sensor of the motor
        sensor: SensorKind = SensorKind::None, 122: word().guarded(Guard::Keep);
        /// resistor between that sensor and the reference of the converter
        sensor_ohm: f32 = 4700.0, 123: number("ohm").from_to(100.0, 1e6).hardware();
        /// band below `motor.sensor_trip_c`, K, in which the torque falls to nothing
        sensor_band_k: u8 = 20, 124: whole().from_to(1.0, 100.0);
        /// temperature of the motor, degC, that trips
        sensor_trip_c: u8 = 140, 125: whole().from_to(2.0, 199.0).guarded(Guard::Lower);
    }

    /// The data on the nameplate of the motor, for the star connection. The rules take the currents and the speed of the
    /// drive from it; see [`rules`](super::rules). Defaults: the dissertation's motor, Table 3.
    Nameplate "nameplate." [nameplate] {
        /// rated power at the shaft
        power_w: f32 = 1100.0, 7: number("W").from_to(50.0, 30_000.0);
        /// rated voltage between lines, rms
        voltage_v: f32 = 380.0, 8: number("V").from_to(24.0, 690.0);
        /// rated current of a line, rms; the rules take their currents from it
        current_a: f32 = 2.56, 9: number("A").from_to(0.05, 1000.0);
        /// rated frequency
        frequency_hz: f32 = 60.0, 10: number("Hz").from_to(25.0, 400.0);
        /// rated speed of the shaft
        speed_rpm: f32 = 1720.0, 11: number("rpm").from_to(150.0, 24_000.0);
    }

    /// The timer and the power stage. Defaults: section 3.9; 220 V rectified.
    Inverter "inverter." [inverter] {
        /// count at which the timer turns round at 6 kHz
        /// (14167 at 170 MHz).
        top: u16 = 14_167, 12: whole().from_to(1000.0, 65_534.0).changed(Change::Board).learned();
        /// Nominal voltage of the dc link, V. Its row is behind that of its sensor, which its range depends on.
        dc_link_v: f32 = 311.0;
        /// time with both switches of a leg off, at every change
        dead_time_s: f32 = 2.2e-6, 13: number("s").from_to(0.0, 6e-6).changed(Change::FromReset).learned().hardware();
        /// whether the dead time is compensated
        compensate: bool = true, 14: word().learned();
        /// phase current from which on the compensation is full
        ///
        /// The rule is three times the spread of noise and prediction.
        full_compensation_a: Option<f32> = None, 15: auto("A", full_compensation_a: |s| s.share_of_range(0.03)).from_to(1e-4, 100.0).learned();
        /// voltage per phase that is lost beyond the dead time, as the commissioning found it; auto: measured at every start
        drop_v: Option<f32> = None, 16: auto("V", drop_v: |_| 0.0).from_to(-50.0, 50.0).learned();
        /// rate of the legs, kHz
        ///
        /// The control runs at 6 kHz: a whole number of equal pulses in each control period. The share of the dead time, the shortest pulse and the
        /// switching losses grow with it. The board has a largest one; shunts below the low sides are sampled at 6 kHz alone.
        carrier_khz: Carrier = Carrier::Khz6, 130: word().changed(Change::FromReset).learned();
    }

    /// Scales of the converters and of the encoder. Defaults: Eq. 3.5; 0.11 V per code (451 V at full scale); the 5305 Hz
    /// filter of Figure 16; 2500 lines.
    Scales "scales." [scales] {
        /// Current a, A.
        current_a: Line = Line::CHANNEL_A => [
            /// current a per code; negative if a current into the motor lowers the code
            "scales.current_a.gain" [scales.current_a] gain: f32, 17: number("A")
                .beside(|s| either_sign(s.scales.current_a.gain, 1e-6, 2.5)).learned().hardware();
            /// current a at code 0
            "scales.current_a.offset" [scales.current_a] offset: f32, 18: number("A")
                .beside(|s| s.offset_range(s.scales.current_a)).learned().hardware();
        ];
        /// Current b, A.
        current_b: Line = Line::CHANNEL_B => [
            /// current b per code
            "scales.current_b.gain" [scales.current_b] gain: f32, 19: number("A")
                .beside(|s| either_sign(s.scales.current_b.gain, 1e-6, 2.5)).learned().hardware();
            /// current b at code 0
            "scales.current_b.offset" [scales.current_b] offset: f32, 20: number("A")
                .beside(|s| s.offset_range(s.scales.current_b)).learned().hardware();
        ];
        /// Current c, A; for three shunts.
        current_c: Line = Line::CHANNEL_B => [
            /// current c per code; with three shunts
            "scales.current_c.gain" [scales.current_c] gain: f32, 21: number("A")
                .beside(|s| either_sign(s.scales.current_c.gain, 1e-6, 2.5)).learned().hardware();
            /// current c at code 0
            "scales.current_c.offset" [scales.current_c] offset: f32, 22: number("A").beside(|s| match s.scales.sensors {
                CurrentSensors::InLine => (-1e4, 1e4),
                CurrentSensors::LowSide => s.offset_range(s.scales.current_c),
            }).learned().hardware();
        ];
        /// sensors of the currents: two in the lines a and b, or three shunts below the low sides
        sensors: CurrentSensors = CurrentSensors::InLine, 23: word().changed(Change::Board).learned();
        /// whether the currents are sampled in both zero vectors, and their mean is used; not with shunts below the low sides
        ///
        /// It has less noise, and is a quarter of a period older.
        both_zero_vectors: bool = false, 24: word().learned();
        /// time from the turn-on of a low side until its shunt can be sampled
        ///
        /// Without the dead time.
        shunt_settle_s: f32 = 2e-6, 25: number("s").from_to(0.0, 20e-6).changed(Change::Board).learned();
        /// Dc-link voltage, V.
        dc_link: Line = Line { gain: 0.11, offset: 0.0 } => [
            /// dc link per code
            "scales.dc_link.gain" [scales.dc_link] gain: f32, 26: number("V").from_to(1e-4, 10.0).learned().hardware();
            /// dc link at code 0
            "scales.dc_link.offset" [scales.dc_link] offset: f32, 27: number("V").from_to(-100.0, 100.0).learned().hardware();
        ];
        /// Code of the highest dc link that the power stage stands in operation. A code, so that no scale lifts it.
        dc_link_highest: u16 = 4095 => [
            /// code of the highest dc link that the power stage stands in operation
            "scales.dc_link.highest" [scales] dc_link_highest: u16, 28: whole().from_to(100.0, 4095.0).changed(Change::Board);
            /// nominal voltage of the dc link
            "inverter.dc_link_v" [inverter] dc_link_v: f32, 29: number("V").beside(|s| (10.0, s.dc_link_max_v()));
        ];
        /// largest code of the currents
        full_scale: u16 = 4095, 30: whole().from_to(100.0, 65_535.0).changed(Change::Board);
        /// Thermistor of the heat sink.
        ntc: Ntc = Ntc::DEFAULT;
        /// delay of the analog filters of the currents
        current_delay_s: f32 = 30e-6, 31: number("s").from_to(0.0, 4.0 * PERIOD_S).learned();
        /// counts of the encoder a turn, four a line
        encoder_counts: u32 = 10_000, 32: whole().from_to(16.0, 1e7);
    }

    /// A thermistor with negative coefficient in a divider across the reference of the converter:
    /// R = R_25 exp(B (1/T - 1/T_25)).
    ///
    /// Defaults, assumed: 10 kohm, B 3435 K, from the reference, with 4.7 kohm to ground. The dissertation describes none.
    Ntc "scales.ntc." [scales.ntc] {
        /// thermistor of the heat sink at 25 degC
        ohm_25: f32 = 10_000.0, 33: number("ohm").from_to(10.0, 1e6).hardware();
        /// its B constant
        beta_k: f32 = 3435.0, 34: number("K").from_to(1000.0, 10_000.0).hardware();
        /// resistor in series with it
        divider_ohm: f32 = 4700.0, 35: number("ohm").from_to(10.0, 1e6).hardware();
        /// whether the thermistor is the one at ground
        ///
        /// The code falls with the temperature then.
        to_ground: bool = false, 36: word().hardware();
    }

    /// An identified plant k / (z - p) at 6 kHz. Unset values follow [`rules`](super::rules).
    IdentifiedPlant "" [] {
        /// Gain, A/V.
        k: Option<f32> = None;
        /// Pole.
        p: Option<f32> = None;
    }

    /// The plants of the current controllers.
    CurrentPlant "" [] {
        /// The one in use.
        source: PlantSource = PlantSource::Identified;
        /// Identified plant of the direct axis.
        d: IdentifiedPlant = IdentifiedPlant::DEFAULT;
        /// Identified plant of the quadrature axis.
        q: IdentifiedPlant = IdentifiedPlant::DEFAULT;
    }

    /// All settings of the drive.
    Settings "" [] {
        /// The motor.
        motor: Motor = Motor::DEFAULT;
        /// Its temperature sensor.
        motor_sensor: MotorSensor = MotorSensor::DEFAULT;
        /// Its nameplate.
        nameplate: Nameplate = Nameplate::DEFAULT;
        /// The timer and the power stage.
        inverter: Inverter = Inverter::DEFAULT;
        /// Scales of converters and encoder.
        scales: Scales = Scales::DEFAULT;
        /// source of the flux angle
        angle_source: AngleSource = AngleSource::Injection, 37: word();
        /// The plant that the current controllers are designed for.
        current_plant: CurrentPlant = CurrentPlant::DEFAULT => [
            /// plant that the current controllers are designed for
            "current_plant" [current_plant] source: PlantSource, 38: word();
            /// identified plant k/(z - p) of the direct axis
            "current_plant.d.k" [current_plant.d] k: Option<f32>, 39: auto("A/V", |s| s.identified_d().k as f32).from_to(1e-6, 1000.0);
            /// its pole
            "current_plant.d.p" [current_plant.d] p: Option<f32>, 40: auto("", |s| s.identified_d().p as f32).from_to(0.0, 0.999_99);
            /// identified plant k/(z - p) of the quadrature axis
            "current_plant.q.k" [current_plant.q] k: Option<f32>, 41: auto("A/V", |s| s.identified_q().k as f32).from_to(1e-6, 1000.0);
            /// its pole
            "current_plant.q.p" [current_plant.q] p: Option<f32>, 42: auto("", |s| s.identified_q().p as f32).from_to(0.0, 0.999_99);
        ];
        /// whether known delays are left uncompensated, as in the dissertation
        ///
        /// Those of the current measurement and of the demodulation, to show what they cost: with the encoder 4.7° at 1440 rpm,
        /// with the injection some 9° at standstill already (the flux slips) and 35° at 150 rpm.
        ignore_delays: bool = false, 43: word().learned();
        /// whether the rotor time constant is tracked while running
        ///
        /// The drive takes the one that `online` finds.
        track_rotor: bool = false, 44: word();
        /// The injection.
        injection: InjectionSettings = InjectionSettings::DEFAULT;
        /// The observer.
        observer: ObserverSettings = ObserverSettings::DEFAULT;
        /// Limits and protections.
        limits: Limits = Limits::DEFAULT;
        /// Start and stop.
        sequence: Sequence = Sequence::DEFAULT;
        /// The speed and the position loop.
        speed: SpeedSettings = SpeedSettings::DEFAULT;
        /// The limits by the dc link.
        braking: BrakingSettings = BrakingSettings::DEFAULT;
        /// The flux beside the torque.
        flux: FluxSettings = FluxSettings::DEFAULT;
        /// The supply of the dc link.
        supply: SupplySettings = SupplySettings::DEFAULT;
        /// The mode for a motor that nobody has identified.
        vf: VoltsPerHertzMode = VoltsPerHertzMode::DEFAULT;
    }

    /// The injection and the tracking of the angle.
    InjectionSettings "injection." [injection] {
        /// peak of the injected voltage; 0 for none
        ///
        /// 50 V (28 % of the largest voltage) is an assumption; the dissertation gives no amplitude. The rule starts from the
        /// reactance X = ω σL_s of the leakage at the carrier.
        ///
        /// The angle error is noise over saliency and carrier current, so the rule asks for a current: 0.368 of the direct
        /// current, 0.26 A of the dissertation's motor at 0.7 A, and at most 0.46 A of it, which the trip leaves room for (family
        /// R at 2 A: 2.9° rms with 0.26 A, 1.7° with 0.46 A). The remainder of the dead time asks for a voltage, 50 V at 311 V.
        /// The larger of both is taken, but not more than the voltage that drives half the direct current, or the 50 V where that is
        /// less: beyond it, phases b and c would cross zero at a start, where the drop of the inverter is uncertain. (With a spindle's
        /// 20 V instead of 36 V the dead time loses the angle on iron.) And not more than the trip leaves room for beside the current
        /// limit. The voltage is between 20 and 110 V at 311 V. Near V_dc / sqrt 3 no room would be left for the fundamental; the lock
        /// monitor needs a carrier.
        amplitude_v: Option<f32> = None, 45: auto("V", carrier_v: Settings::carrier_rule)
            .beside(|s| (if s.watches_lock() { 0.003 * s.inverter.dc_link_v } else { 0.0 }, 0.55 * s.inverter.dc_link_v)).learned();
        /// demodulation of the carrier current
        demodulator: DemodulatorKind = DemodulatorKind::Synchronous, 46: word().learned();
        /// Settings of the chain of the dissertation.
        printed: PrintedChain = PrintedChain::DEFAULT;
        /// Settings of the synchronous demodulation.
        synchronous: SynchronousTracking = SynchronousTracking::DEFAULT;
        /// Inject and demodulate also while the angle comes from the encoder. Its row is the last of the injection.
        beside_encoder: bool = false;
    }

    /// Tracking loop of sections 3.4 and 3.11, for all demodulators but the synchronous one. Defaults: sections 3.3 and 3.11.
    PrintedChain "injection." [injection.printed] {
        /// reference of the current difference; not synchronous
        ///
        /// `ref_delta_i` (section 3.3) from [`full_reference_iq_a`](Self::full_reference_iq_a) on. It must be odd in i_q, so it
        /// follows the sign of i_q, and goes through zero linearly.
        reference_a: f32 = 0.010, 47: number("A").from_to(-1.0, 1.0).learned();
        /// torque current from which on that reference is full
        full_reference_iq_a: Option<f32> = None, 48: auto("A", full_reference_iq_a: |s| s.share_of_rated(1.0)).from_to(0.01, 1000.0).learned();
        /// gain of the tracker (Eq. 3.44); not synchronous
        k_s: f32 = 0.132_546, 49: number("rad/A").from_to(0.0, 100.0);
        /// its zero
        z_s: f32 = 0.90, 50: number().from_to(0.0, 1.0);
        /// length of the filters of rms-impedance
        ///
        /// In samples of [`DemodulatorKind::RmsImpedance`]; the default is two carrier periods.
        rms_samples: u8 = 20, 51: whole().from_to(DemodulatorKind::RMS_SAMPLES.0 as f32, DemodulatorKind::RMS_SAMPLES.1 as f32).learned();
        /// Reference of the current difference over the torque current, A, learned with the shaft locked;
        /// replaces the constant one.
        learned: Option<ReferenceTable> = None;
    }

    /// Synchronous demodulation and its loop.
    SynchronousTracking "injection." [injection.synchronous] {
        /// natural frequency of the tracking without an observer
        ///
        /// Without an encoder the speed loop is designed for it in any case.
        bandwidth_hz: f32 = 3.5, 52: number("Hz").from_to(0.1, 30.0);
        /// saliency fixed to the flux, until its slope is learned
        ///
        /// At the nominal magnetising current. Negative: the inductance along the flux is the larger one. Near zero the loop would
        /// have no gain.
        flux_saliency: f32 = -0.035, 53: number().beside(|s| either_sign(s.injection.synchronous.flux_saliency, 0.001, 0.3));
        /// whether a drive that has not learned starts without an encoder
        ///
        /// For motors whose saliency is known from elsewhere, as that of a model.
        allow_unlearned: bool = false, 54: word().guarded(Guard::Lower);
        /// saliency per ampere of stator current
        ///
        /// For the observer until it is learned.
        current_saliency: Option<f32> = None, 55: auto("1/A", current_saliency: |s| 0.0338 * RATED_A / s.rated_a()).from_to(-30.0, 30.0).learned();
        /// Reference of the saliency over the torque current, learned with the shaft locked; unset: guessed.
        reference: Option<ReferenceTable> = None;
        /// whether a start checks the saliency of the motor
        ///
        /// See `saliency_check`. Without the check a start assumes it, and a shaft at standstill.
        check: bool = true, 56: word().guarded(Guard::Raise);
        /// whether the lock is verified and watched
        ///
        /// See `lock_monitor`.
        monitor: bool = true, 57: word().guarded(Guard::Raise);
        /// Carrier current over the torque current, learned with the shaft locked, for the monitor; unset: guessed.
        carrier: Option<CarrierTable> = None;
        /// share of the flux-fixed saliency that may be missing
        ///
        /// 1 is zero flux.
        allowed_loss: f32 = 0.55, 58: number().from_to(0.3, 0.9).guarded(Guard::Lower);
        /// time constant of the mean of that share
        loss_s: f32 = 0.12, 59: number("s").from_to(0.01, 1.0).guarded(Guard::Lower);
        /// speed that trips without an encoder
        ///
        /// Mechanical: the end of the range in which the angle is tracked.
        tracked_rpm: Option<f32> = None, 60: auto("rpm", tracked_rpm: |s| s.share_of_poles(700.0)).from_to(1.0, 20_000.0).guarded(Guard::Lower) => [
            /// whether the carrier is injected beside an encoder
            "injection.beside_encoder" [injection] beside_encoder: bool, 61: word();
        ];
    }

    /// The observer that takes the angle over from the injection at speed; see `drive_core::flux::observer`.
    ObserverSettings "observer." [observer] {
        /// whether the voltage of the motor gives the angle at speed, where the injection ends
        ///
        /// Without it the drive trips at [`tracked_rpm`](SynchronousTracking::tracked_rpm).
        enabled: bool = true, 62: word();
        /// leakage inductance of the fundamental wave at no current, as a share of that of motor.*
        leakage_share: f32 = 1.0, 63: number().from_to(0.5, 2.0);
        /// change of that share per ampere of stator current, peak
        leakage_slope: f32 = 0.0, 64: number("1/A").from_to(-10.0, 10.0);
    }

    /// Limits and protections. Unset ones follow [`rules`](super::rules).
    Limits "limits." [limits] {
        /// phase current that trips
        ///
        /// A trip level beyond the sensors' range would never be reached.
        trip_a: Option<f32> = None, 65: auto("A", trip_a: |s| f32::min(TRIP_OF_RATED * s.rated_a(), TRIP_OF_RANGE * s.sensor_range_a()))
            .beside(|s| (0.05, s.sensor_range_a())).hardware();
        /// largest current that is regulated, peak
        ///
        /// The length of the current vector. With high flux that of 155 % of the rated torque, 1 to 1.6 times the rated current. The
        /// carrier and the noise stay clear of the trip.
        current_a: Option<f32> = None, 66: auto("A", current_limit_a: |s| s.wanted_limit_a().min(s.limit_of_trip() * s.trip_a()))
            .beside(|s| (0.01, s.trip_a())).guarded(Guard::Lower);
        /// dc link above which the drive trips
        dc_over_v: Option<f32> = None, 67: auto("V", dc_over_v: |s| s.share_of_dc_link(400.0).min(WITHIN * s.dc_over_max_v()).min(0.95 * s.dc_link_range_v()))
            .beside(Settings::dc_over_range).hardware();
        /// dc link below which it trips while the outputs are on
        dc_under_v: Option<f32> = None, 68: auto("V", dc_under_v: |s| s.share_of_dc_link(200.0)).beside(Settings::dc_under_range).guarded(Guard::Raise);
        /// speed of the shaft that trips
        ///
        /// At most 500 Hz electrical: without an encoder the rotor is counted 1200 times a second, and half a turn is the most it may
        /// move in between.
        speed_rpm: Option<f32> = None, 69: auto("rpm", speed_trip_rpm: |s| 2000.0 / Nameplate::DEFAULT.speed_rpm * s.nameplate.speed_rpm)
            .beside(|s| (1.0, 500.0 / s.nameplate.frequency_hz * s.nameplate.speed_rpm)).guarded(Guard::Lower);
        /// largest voltage that the motor model does not explain at standstill
        ///
        /// By rule an error of 26 % of the stator resistance at the current limit, and 2.3 % of the dc link for dead time and drop
        /// of the inverter; the dc link at most.
        unexplained_v: Option<f32> = None,
            70: auto("V", unexplained_v: |s| (0.26 * s.current_limit_a() * s.motor.r_s + s.share_of_dc_link(7.086)).min(s.inverter.dc_link_v)).from_to(0.01, 1000.0).guarded(Guard::Lower);
        /// current that the motor carries for any time at standstill, peak
        motor_a: Option<f32> = None, 71: auto("A", motor_a: |s| s.rated_a()).beside(|s| (0.01, 3.0 * s.rated_a())).guarded(Guard::Lower);
        /// thermal time constant of its windings
        ///
        /// By default between those of the trip classes 10 and 20 (IEC 60947-4-1: 7.2 times the rated current for 10 and 20 s mean 518 and
        /// 1037 s): a warm motor bears 150 % of its torque for 60 s.
        motor_s: f32 = 600.0, 72: number("s").from_to(1.0, 10_000.0).guarded(Guard::Lower);
        /// current that the inverter carries for any time, peak
        inverter_a: Option<f32> = None, 73: auto("A", inverter_a: |s| s.current_limit_a()).beside(|s| (0.01, s.trip_a())).guarded(Guard::Lower);
        /// thermal time constant of its switches to the heat sink
        inverter_s: f32 = 5.0, 74: number("s").from_to(0.1, 1000.0).guarded(Guard::Lower);
        /// temperature of the heat sink that trips
        ///
        /// The default suits most power modules.
        heat_sink_c: f32 = 85.0, 75: number("degC").from_to(0.0, 150.0).hardware();
        /// temperature of the heat sink from which on the current limit falls, to nothing where it trips
        derate_c: Option<f32> = None, 76: auto("degC", derate_c: |s| s.limits.heat_sink_c - 15.0).beside(|s| (-40.0, s.limits.heat_sink_c)).guarded(Guard::Lower);
        /// largest current from the dc link, motoring; 1000 for none
        ///
        /// A limit lies above the copper losses of the direct current.
        dc_motoring_a: f32 = DcLimit::NONE.current_a, 126: number("A").beside(|s| (s.magnetising_w() / s.inverter.dc_link_v, DcLimit::NONE.current_a)).guarded(Guard::Lower);
        /// largest current into the dc link, generating; 1000 for none
        dc_generating_a: f32 = DcLimit::NONE.current_a, 127: number("A").from_to(0.0, DcLimit::NONE.current_a).guarded(Guard::Lower);
        /// largest power from the dc link, motoring; 1e6 for none
        motoring_w: f32 = DcLimit::NONE.power_w, 128: number("W").beside(|s| (s.magnetising_w(), DcLimit::NONE.power_w)).guarded(Guard::Lower);
        /// largest power into the dc link, generating; 1e6 for none
        generating_w: f32 = DcLimit::NONE.power_w, 129: number("W").from_to(0.0, DcLimit::NONE.power_w).guarded(Guard::Lower);
    }

    /// The sequence between `start` and regulation, and at `stop`. Unset values follow [`rules`](super::rules).
    Sequence "sequence." [sequence] {
        /// time of the offset calibration
        calibrate_s: f32 = 0.1, 77: number("s").from_to(0.001, 10.0);
        /// time with the low sides on
        precharge_s: f32 = 0.010, 78: number("s").from_to(0.0, 10.0);
        /// time with direct current alone
        ///
        /// The flux is within 1 % after five rotor time constants. The lock monitor measures its baseline in this time; with the
        /// saliency check also while the flux is restored.
        magnetise_s: Option<f32> = None, 79: auto("s", magnetise_s: |s| f32::max(0.8, 5.0 * s.motor.tau_r()))
            .beside(|s| (if s.watches_lock() && !s.injection.synchronous.check { 0.5 } else { 0.0 }, 60.0));
        /// flux that the rule for the direct current aims at: low as in the dissertation, or high
        flux: Flux = Flux::Low, 80: word().learned();
        /// direct (magnetising) current, peak
        ///
        /// 0.7 A is that of section 3.10. With high flux it is that of the rated flux, but at most the one of the largest torque of the
        /// rated current and of the current limit: 0.707 times these.
        i_d: Option<f32> = None, 81: auto("A", i_d: Settings::i_d_rule).beside(|s| (0.01, s.current_limit_a())).learned();
        /// slope of the torque current at a stop
        stop_a_per_s: Option<f32> = None, 82: auto("A/s", stop_a_per_s: |s| s.share_of_rated(30.0)).from_to(0.1, 1e5).guarded(Guard::Raise);
        /// whether a start with the observer looks for a turning shaft first
        ///
        /// For 0.25 s, without an encoder.
        catch: bool = true, 83: word();
    }

    /// The flux beside the torque; see `drive_core::current::voltage_limit`.
    FluxSettings "flux." [flux] {
        /// whether the flux is that of the least loss where there is no carrier
        ///
        /// Half of that of `sequence.i_d` to all of it. A torque current gives less torque then, and a torque step beyond the present flux
        /// takes a rotor time constant.
        economy: bool = false, 84: word();
    }

    /// The speed loop, and the position loop around it. Unset values follow [`rules`](super::rules).
    SpeedSettings "speed." [speed] {
        /// largest torque current of speed and position mode
        i_q_limit_a: Option<f32> = None, 85: auto("A", i_q_limit_a: |s| 3.0 / 3.5 * s.current_limit_a()).beside(|s| (0.01, s.current_limit_a()));
        /// largest speed that is asked for
        ///
        /// In either mode. By rule the rated speed with the observer. The injection alone is good to 300 rpm on four poles; with an
        /// encoder it may be larger.
        limit_rpm: Option<f32> = None, 86: auto("rpm", speed_limit_rpm: |s| (if s.uses_observer() { s.nameplate.speed_rpm } else { s.share_of_poles(300.0) }).min(WITHIN * s.speed_trip_rpm()))
            .beside(|s| (1.0, s.speed_trip_rpm())).guarded(Guard::Lower);
        /// largest acceleration that is asked for
        ramp_rpm_per_s: Option<f32> = None, 87: auto("rpm/s", ramp_rpm_per_s: |s| s.share_of_poles(300.0)).from_to(1.0, 1e5).guarded(Guard::Raise);
        /// deceleration of a quick stop
        quick_rpm_per_s: Option<f32> = None, 88: auto("rpm/s", quick_rpm_per_s: |s| 3.0 * s.ramp_rpm_per_s()).beside(|s| (s.ramp_rpm_per_s(), 3e5)).guarded(Guard::Raise);
        /// time in which the acceleration comes to its full value, in speed mode and in a stop by the ramp; 0 for at once
        s_ramp_s: f32 = 0.0, 89: number("s").from_to(0.0, 10.0).guarded(Guard::Lower);
        /// phase margin of the speed loop: more is calmer and slower; without an encoder 45 only with a stiff shaft
        ///
        /// Below 45 degrees the position loop, with some 12 less, rings; the zero allows 76 at most.
        phase_margin_deg: f32 = 60.0, 90: number("deg").from_to(45.0, 70.0);
    }

    /// Limits of the torque by the voltage of the dc link, and the brake resistor; see `drive_core::dc_link`. Unset values follow
    /// [`rules`](super::rules). By default there is no brake resistor; where one is fitted, its energy and power stand on it.
    BrakingSettings "braking." [braking] {
        /// dc link without generating torque
        high_v: Option<f32> = None, 91: auto("V", dc_high_v: |s| s.share_of_dc_link(390.0).min(HIGH_OF_TRIP * s.dc_over_v()).min(WITHIN * s.highest_dc_link_v()))
            .beside(|s| (s.inverter.dc_link_v + MARGIN * s.inverter.dc_link_v, s.dc_over_v().min(s.highest_dc_link_v())));
        /// dc link without motoring torque, below which the shaft feeds it
        low_v: Option<f32> = None, 92: auto("V", dc_low_v: |s| f32::max(s.share_of_dc_link(260.0), LOW_OF_TRIP * s.dc_under_v()))
            .beside(|s| (s.dc_under_v() + MARGIN * s.dc_under_v(), s.inverter.dc_link_v - MARGIN * s.inverter.dc_link_v));
        /// direct current that is added while generating torque is limited; 0 for none
        flux_a: Option<f32> = None, 93: auto("A", braking_flux_a: |s| f32::min(s.share_of_rated(1.0), WITHIN * s.current_limit_a()))
            .beside(|s| (0.0, s.current_limit_a()));
        /// brake resistor behind the chopper; 0 for none
        ohm: f32 = 0.0, 94: number("ohm").from_to(0.0, 1e5).guarded(Guard::Keep);
        /// energy that the brake resistor takes from cold
        energy_j: f32 = 1000.0, 95: number("J").from_to(1.0, 1e7).guarded(Guard::Lower);
        /// power that it takes for ever
        power_w: f32 = 50.0, 96: number("W").from_to(0.1, 1e5).guarded(Guard::Lower);
    }

    /// The supply of the dc link.
    SupplySettings "supply." [supply] {
        /// time that the dc link must be steady before the precharge relay closes; 0 without one
        ///
        /// See `drive_core::supply`.
        relay_s: f32 = 0.0, 97: number("s").from_to(0.0, 60.0).guarded(Guard::Raise);
    }

    /// The mode for a motor that nobody has identified; see `drive_core::flux::volts_per_hertz`. Unset values follow
    /// [`rules`](super::rules).
    VoltsPerHertzMode "vf." [vf] {
        /// voltage between lines, rms, per frequency, of a motor that nobody has identified
        volts_per_hz: Option<f32> = None, 98: auto("V/Hz", volts_per_hz: |s| s.nameplate.voltage_v / s.nameplate.frequency_hz).from_to(0.01, 200.0);
        /// current of this motor at standstill, peak
        ///
        /// By rule the magnetising current of most motors, 0.45 times the rated current.
        boost_a: Option<f32> = None, 99: auto("A", boost_a: |s| f32::min(0.45 * s.rated_a(), 0.6 * s.current_limit_a()))
            .beside(|s| (0.01, s.current_limit_a()));
        /// share of its slip that is compensated
        slip_share: f32 = 1.0, 100: number().from_to(0.0, 1.5);
    }
}

/// The setting with this name.
pub fn find(name: &str) -> Option<&'static Entry<Settings>> {
    SETTINGS.iter().find(|entry| entry.name == name)
}
