//! The settings: field, default, unit, range, rule, help, who may change it, whether learned values depend on it, and whether
//! the power stage is at stake. To add one, add a row; [`declare`](super::declare) says what a row is.
//!
//! Structures, defaults, console, saved record, checks, keys of the simulator and documentation come from this table. It is one
//! long file, so that the settings stand in the order in which they are shown.
//!
//! A rule scales a number that was tried on the dissertation's motor and board in proportion to the quantity on which it
//! depends; see [`rules`](super::rules).

use core::f32::consts::SQRT_2;

use super::declare::{rule, settings};
use super::entry::{Access, Change, Entry, Guard, entry};
use super::numbers::{HIGH_OF_TRIP, LOW_OF_TRIP, MARGIN, TRIP_OF_RANGE, TRIP_OF_RATED, WITHIN};
use super::numbers::{either_sign, or_rule};
use super::value::Words;
use super::{Carrier, CurrentSensors, Flux, InjectionAxis, PlantSource, SensorKind};
use drive_core::blocks::Catch;
use drive_core::printed::DemodulatorKind;
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
        /// pole pairs
        "motor.pole_pairs" [motor] pole_pairs: u8, 5: whole().from_to(1.0, 6.0).learned();
        /// inertia of rotor and load, for the speed loop; auto: rated speed after 0.15 s of rated torque, until `commission inertia`
        "motor.inertia" [] inertia: Option<f32>, 6: auto("kg m2", Settings::inertia).from_to(1e-7, 1000.0);
    ];

    /// The temperature sensor of the motor, from ground to an input of the board, fed from the reference of the ADC.
    MotorSensor "motor." [motor_sensor] {
        /// temperature sensor of the motor
        sensor: SensorKind = SensorKind::None, 122: word().guarded(Guard::Keep);
        /// resistor between the temperature sensor of the motor and the reference of the ADC
        sensor_ohm: f32 = 4700.0, 123: number("ohm").from_to(100.0, 1e6).hardware();
        /// band below `motor.sensor_trip_c`, K, in which the torque falls to zero
        sensor_band_k: u8 = 20, 124: whole().from_to(1.0, 100.0);
        /// temperature of the motor, degC, that trips
        sensor_trip_c: u8 = 140, 125: whole().from_to(2.0, 199.0).guarded(Guard::Lower);
    }

    /// The data on the nameplate of the motor, for the star connection. The rules for the currents and the speed of the
    /// drive use it; see [`rules`](super::rules). Defaults: the dissertation's motor, Table 3.
    Nameplate "nameplate." [nameplate] {
        /// rated power at the shaft
        power_w: f32 = 1100.0, 7: number("W").from_to(50.0, 30_000.0);
        /// rated voltage between lines, rms
        voltage_v: f32 = 380.0, 8: number("V").from_to(24.0, 690.0);
        /// rated line current, rms; the `auto` rules derive the current limits from it
        current_a: f32 = 2.56, 9: number("A").from_to(0.05, 1000.0);
        /// rated frequency
        frequency_hz: f32 = 60.0, 10: number("Hz").from_to(25.0, 400.0);
        /// rated speed of the shaft
        speed_rpm: f32 = 1720.0, 11: number("rpm").from_to(150.0, 24_000.0);
    }

    /// The timer and the power stage. Defaults: section 3.9; 220 V rectified.
    Inverter "inverter." [inverter] {
        /// count at which the timer reverses at 6 kHz
        /// (14167 at 170 MHz).
        top: u16 = 14_167, 12: whole().from_to(1000.0, 65_534.0).changed(Change::Board).learned();
        /// Nominal voltage of the dc link, V. Its row comes after the row of its sensor, on which its range depends.
        dc_link_v: f32 = 311.0;
        /// time with both switches of a leg off, at every change
        dead_time_s: f32 = 2.2e-6, 13: number("s").from_to(0.0, 6e-6).changed(Change::FromReset).learned().hardware();
        /// whether the dead time is compensated
        compensate: bool = true, 14: word().learned();
        /// phase current above which the dead-time compensation acts in full
        ///
        /// The rule gives three times the spread of noise and prediction.
        full_compensation_a: Option<f32> = None, 15: auto("A", full_compensation_a: |s| s.share_of_range(0.03)).from_to(1e-4, 100.0).learned();
        /// inverter voltage error per phase beyond the dead time, from commissioning; auto: measured at every start
        drop_v: Option<f32> = None, 16: auto("V", drop_v: |_| 0.0).from_to(-50.0, 50.0).learned();
        /// switching frequency, kHz
        ///
        /// The control runs at 6 kHz, with a whole number of equal pulses in each control period. The share of the dead time, the shortest
        /// pulse and the switching losses grow with the switching frequency. Every board has a largest one. Shunts below the low sides are
        /// sampled at 6 kHz only.
        switching_khz: Carrier = Carrier::Khz6, 130: word().changed(Change::FromReset).learned();
    }

    /// Scales of the ADCs and of the encoder. Defaults: Eq. 3.5; 0.11 V per ADC count (451 V at full scale); the 5305 Hz
    /// filter of Figure 16; 2500 lines.
    Scales "scales." [scales] {
        /// Current a, A.
        current_a: Line = Line::CHANNEL_A => [
            /// current a per ADC count; negative if current into the motor lowers it
            "scales.current_a.gain" [scales.current_a] gain: f32, 17: number("A")
                .beside(|s| either_sign(s.scales.current_a.gain, 1e-6, 2.5)).learned().hardware();
            /// current a at 0 ADC counts
            "scales.current_a.offset" [scales.current_a] offset: f32, 18: number("A")
                .beside(|s| s.offset_range(s.scales.current_a)).learned().hardware();
        ];
        /// Current b, A.
        current_b: Line = Line::CHANNEL_B => [
            /// current b per ADC count
            "scales.current_b.gain" [scales.current_b] gain: f32, 19: number("A")
                .beside(|s| either_sign(s.scales.current_b.gain, 1e-6, 2.5)).learned().hardware();
            /// current b at 0 ADC counts
            "scales.current_b.offset" [scales.current_b] offset: f32, 20: number("A")
                .beside(|s| s.offset_range(s.scales.current_b)).learned().hardware();
        ];
        /// Current c, A; for three shunts.
        current_c: Line = Line::CHANNEL_B => [
            /// current c per ADC count; with three shunts
            "scales.current_c.gain" [scales.current_c] gain: f32, 21: number("A")
                .beside(|s| either_sign(s.scales.current_c.gain, 1e-6, 2.5)).learned().hardware();
            /// current c at 0 ADC counts
            "scales.current_c.offset" [scales.current_c] offset: f32, 22: number("A").beside(|s| match s.scales.sensors {
                CurrentSensors::InLine => (-1e4, 1e4),
                CurrentSensors::LowSide => s.offset_range(s.scales.current_c),
            }).learned().hardware();
        ];
        /// current sensors: two in lines a and b, or three shunts below the low sides
        sensors: CurrentSensors = CurrentSensors::InLine, 23: word().changed(Change::Board).learned();
        /// whether currents are means of samples in both zero vectors; not with shunts
        ///
        /// The mean has less noise, and is a quarter of a period older.
        both_zero_vectors: bool = false, 24: word().learned();
        /// time from turn-on of a low side until its shunt can be sampled
        ///
        /// The dead time is not included.
        shunt_settle_s: f32 = 2e-6, 25: number("s").from_to(0.0, 20e-6).changed(Change::Board).learned();
        /// Dc-link voltage, V.
        dc_link: Line = Line { gain: 0.11, offset: 0.0 } => [
            /// dc link per ADC count
            "scales.dc_link.gain" [scales.dc_link] gain: f32, 26: number("V").from_to(1e-4, 10.0).learned().hardware();
            /// dc link at 0 ADC counts
            "scales.dc_link.offset" [scales.dc_link] offset: f32, 27: number("V").from_to(-100.0, 100.0).learned().hardware();
        ];
        /// ADC counts at the maximum operating voltage. They are counts so that no scale can raise the limit.
        dc_link_highest: u16 = 4095 => [
            /// ADC counts at the maximum operating voltage
            "scales.dc_link.highest" [scales] dc_link_highest: u16, 28: whole().from_to(100.0, 4095.0).changed(Change::Board);
            /// nominal voltage of the dc link
            "inverter.dc_link_v" [inverter] dc_link_v: f32, 29: number("V").beside(|s| (10.0, s.dc_link_max_v()));
        ];
        /// ADC counts of the currents at full scale
        full_scale: u16 = 4095, 30: whole().from_to(100.0, 65_535.0).changed(Change::Board);
        /// Thermistor of the heat sink.
        ntc: Ntc = Ntc::DEFAULT;
        /// delay of the analog filters of the currents
        current_delay_s: f32 = 30e-6, 31: number("s").from_to(0.0, 4.0 * PERIOD_S).learned();
        /// counts of the encoder per turn, four per line
        encoder_counts: u32 = 10_000, 32: whole().from_to(16.0, 1e7);
    }

    /// A thermistor with negative coefficient in a divider across the reference of the ADC: R =
    /// R_25 exp(B (1/T - 1/T_25)).
    ///
    /// Defaults, assumed: 10 kohm, B 3435 K, from the reference, with 4.7 kohm to ground. The dissertation describes none.
    Ntc "scales.ntc." [scales.ntc] {
        /// thermistor of the heat sink at 25 degC
        ohm_25: f32 = 10_000.0, 33: number("ohm").from_to(10.0, 1e6).hardware();
        /// B constant of that thermistor
        beta_k: f32 = 3435.0, 34: number("K").from_to(1000.0, 10_000.0).hardware();
        /// series resistor of the thermistor
        divider_ohm: f32 = 4700.0, 35: number("ohm").from_to(10.0, 1e6).hardware();
        /// whether the thermistor is the one at ground
        ///
        /// If it is, the ADC counts fall with the temperature.
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
        /// The plant in use.
        source: PlantSource = PlantSource::Identified;
        /// Identified plant of the d axis.
        d: IdentifiedPlant = IdentifiedPlant::DEFAULT;
        /// Identified plant of the q axis.
        q: IdentifiedPlant = IdentifiedPlant::DEFAULT;
    }

    /// All settings of the drive.
    Settings "" [] {
        /// The motor.
        motor: Motor = Motor::DEFAULT;
        /// Inertia of rotor and load, kg m²; `None`: assumed, see [`Settings::inertia`].
        inertia: Option<f32> = None;
        /// The temperature sensor of the motor.
        motor_sensor: MotorSensor = MotorSensor::DEFAULT;
        /// The nameplate of the motor.
        nameplate: Nameplate = Nameplate::DEFAULT;
        /// The timer and the power stage.
        inverter: Inverter = Inverter::DEFAULT;
        /// Scales of the ADCs and of the encoder.
        scales: Scales = Scales::DEFAULT;
        /// source of the flux angle
        angle_source: AngleSource = AngleSource::Injection, 37: word();
        /// The plant for which the current controllers are designed.
        current_plant: CurrentPlant = CurrentPlant::DEFAULT => [
            /// plant that the current controllers are designed for
            "current_plant" [current_plant] source: PlantSource, 38: word();
            /// gain k of the d-axis plant k/(z - p)
            "current_plant.d.k" [current_plant.d] k: Option<f32>, 39: auto("A/V", |s| s.identified_d().k as f32).from_to(1e-6, 1000.0);
            /// pole p of the d-axis plant
            "current_plant.d.p" [current_plant.d] p: Option<f32>, 40: auto("", |s| s.identified_d().p as f32).from_to(0.0, 0.999_99);
            /// gain k of the q-axis plant k/(z - p)
            "current_plant.q.k" [current_plant.q] k: Option<f32>, 41: auto("A/V", |s| s.identified_q().k as f32).from_to(1e-6, 1000.0);
            /// pole p of the q-axis plant
            "current_plant.q.p" [current_plant.q] p: Option<f32>, 42: auto("", |s| s.identified_q().p as f32).from_to(0.0, 0.999_99);
        ];
        /// whether known delays are left uncompensated, as in the dissertation
        ///
        /// These are the delays of the current measurement and of the demodulation. The setting shows the error that they
        /// cause: with the encoder 4.7° at 1440 rpm, with the injection about 9° even at standstill (the flux slips) and 35° at
        /// 150 rpm.
        ignore_delays: bool = false, 43: word().learned();
        /// whether the rotor time constant is tracked while running
        ///
        /// The drive uses the time constant that `online` estimates.
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
        /// The limits of the torque by the voltage of the dc link.
        braking: BrakingSettings = BrakingSettings::DEFAULT;
        /// The choice of the flux.
        flux: FluxSettings = FluxSettings::DEFAULT;
        /// The supply of the dc link.
        supply: SupplySettings = SupplySettings::DEFAULT;
        /// V/f control, for a motor that was not identified.
        vf: VoltsPerHertzMode = VoltsPerHertzMode::DEFAULT;
    }

    /// The injection and the tracking of the angle.
    InjectionSettings "injection." [injection] {
        /// peak of the injected voltage; 0 for none
        ///
        /// 50 V (28 % of the largest voltage) is an assumption, since the dissertation gives no amplitude. The rule starts
        /// from the reactance X = ω σL_s of the leakage at the injection frequency.
        ///
        /// The angle error is the noise divided by the saliency and by the injection current, so the rule aims at a current: 0.368 of
        /// the d-axis current, which is 0.26 A for the dissertation's motor at 0.7 A, and at most 0.46 A for this motor, which is
        /// still below the trip (saturation model R at 2 A: 2.9° rms with 0.26 A, 1.7° with 0.46 A). The uncompensated rest of the
        /// dead time requires a least voltage, 50 V at 311 V. The larger of the two voltages is taken, with three limits. It is not
        /// larger than the voltage that drives half of the d-axis current, or 50 V if that is larger: otherwise phases b and c would
        /// cross zero at a start, where the inverter voltage error is uncertain. (With a spindle's 20 V instead of 36 V, a motor that
        /// saturates loses the lock because of the dead time.) The injection current fits between the current limit and the trip. And
        /// the voltage is between 20 V and 110 V at 311 V: near V_dc / sqrt 3 no voltage would be left for the fundamental, and the
        /// lock monitor needs an injection. At last [`torque_pct`](Self::torque_pct) bounds the torque ripple.
        amplitude_v: Option<f32> = None, 45: auto("V", carrier_v: Settings::carrier_rule)
            .beside(|s| (if s.watches_lock() { 0.003 * s.inverter.dc_link_v } else { 0.0 }, 0.55 * s.inverter.dc_link_v)).learned();
        /// largest torque ripple of the injection on the q axis, of the rated torque
        ///
        /// It is the amplitude at 600 Hz and bounds `injection.amplitude_v` unless that is set, down to 35 V at 311 V, which the dead time
        /// requires of motors with little leakage. With half of the ripple the angle error of
        /// a simulated motor grows from 0.9° to 1.6° rms and from 5° to 20° at most (`krause-3hp`, plant R); with 0.9 of it, by 0.1° rms.
        torque_pct: f32 = 20.0, 134: number("%").from_to(1.0, 200.0);
        /// axis of the injection in the frame of the flux
        ///
        /// The dissertation prescribes the q axis. There the injection current makes torque; on the d axis it makes almost none, and shows
        /// the same saliency. The angle errors at constant torque are about equal; in torque steps those of the d axis are one to three
        /// times as large.
        axis: InjectionAxis = InjectionAxis::Q, 135: word().learned();
        /// demodulation of the injection current
        demodulator: DemodulatorKind = DemodulatorKind::Synchronous, 46: word().learned();
        /// Settings of the chain of the dissertation.
        printed: PrintedChain = PrintedChain::DEFAULT;
        /// Settings of the synchronous demodulation.
        synchronous: SynchronousTracking = SynchronousTracking::DEFAULT;
        /// Whether to inject and demodulate also while the angle comes from the encoder. Its row is the last of the injection.
        beside_encoder: bool = false;
    }

    /// Tracking loop of sections 3.4 and 3.11, for all demodulators but the synchronous one. Defaults: sections 3.3 and 3.11.
    PrintedChain "injection." [injection.printed] {
        /// reference of the current difference; not synchronous
        ///
        /// This is `ref_delta_i` (section 3.3) for currents of at least [`full_reference_iq_a`](Self::full_reference_iq_a). The
        /// reference must be odd in i_q, so it follows the sign of i_q and goes through zero linearly.
        reference_a: f32 = 0.010, 47: number("A").from_to(-1.0, 1.0).learned();
        /// q-axis current from which on that reference is full
        full_reference_iq_a: Option<f32> = None, 48: auto("A", full_reference_iq_a: |s| s.share_of_rated(1.0)).from_to(0.01, 1000.0).learned();
        /// gain of the tracker (Eq. 3.44); not synchronous
        k_s: f32 = 0.132_546, 49: number("rad/A").from_to(0.0, 100.0);
        /// zero of that tracker
        z_s: f32 = 0.90, 50: number().from_to(0.0, 1.0);
        /// length of the filters of rms-impedance
        ///
        /// The length is in samples of [`DemodulatorKind::RmsImpedance`]; the default is two injection periods.
        rms_samples: u8 = 20, 51: whole().from_to(DemodulatorKind::RMS_SAMPLES.0 as f32, DemodulatorKind::RMS_SAMPLES.1 as f32).learned();
        /// Reference of the current difference over the q-axis current, A, learned with the shaft locked.
        /// It replaces the constant reference.
        learned: Option<ReferenceTable> = None;
    }

    /// Synchronous demodulation and its loop.
    SynchronousTracking "injection." [injection.synchronous] {
        /// natural frequency of the tracking without an observer
        ///
        /// Without an encoder the speed loop is always designed for this frequency.
        bandwidth_hz: f32 = 3.5, 52: number("Hz").from_to(0.1, 30.0);
        /// saliency fixed to the flux, until learned
        ///
        /// The value is valid at the nominal magnetising current. If it is negative, the inductance along the flux is the larger
        /// one. Near zero the loop would have no gain.
        flux_saliency: f32 = -0.035, 53: number().beside(|s| either_sign(s.injection.synchronous.flux_saliency, 0.001, 0.3));
        /// whether an unlearned drive starts without an encoder
        ///
        /// It is meant for motors whose saliency is known from elsewhere, for example from a simulation model.
        allow_unlearned: bool = false, 54: word().guarded(Guard::Lower);
        /// saliency per ampere of stator current
        ///
        /// The observer uses it until the saliency is learned.
        current_saliency: Option<f32> = None, 55: auto("1/A", current_saliency: |s| 0.0338 * RATED_A / s.rated_a()).from_to(-30.0, 30.0).learned();
        /// Saliency offset over the q-axis current, learned with the shaft locked; guessed if unset.
        reference: Option<ReferenceTable> = None;
        /// whether a start checks the saliency of the motor
        ///
        /// See `saliency_check`. Without the check, a start assumes a saliency and a shaft at standstill.
        check: bool = true, 56: word().guarded(Guard::Raise);
        /// whether the lock is verified and watched
        ///
        /// See `lock_monitor`.
        monitor: bool = true, 57: word().guarded(Guard::Raise);
        /// Injection current over the q-axis current for the lock monitor, learned with the shaft locked; guessed if unset.
        carrier: Option<CarrierTable> = None;
        /// allowed saliency deficit, a share
        ///
        /// 1 means zero flux.
        allowed_deficit: f32 = 0.55, 58: number().from_to(0.3, 0.9).guarded(Guard::Lower);
        /// time constant of the mean of the saliency deficit
        deficit_s: f32 = 0.12, 59: number("s").from_to(0.01, 1.0).guarded(Guard::Lower);
        /// speed that trips without an encoder
        ///
        /// It is mechanical: the end of the range in which the angle is tracked.
        tracked_rpm: Option<f32> = None, 60: auto("rpm", tracked_rpm: |s| s.share_of_poles(700.0)).from_to(1.0, 20_000.0).guarded(Guard::Lower) => [
            /// whether the voltage is also injected with an encoder
            "injection.beside_encoder" [injection] beside_encoder: bool, 61: word();
        ];
    }

    /// The back-EMF observer that takes over from the injection at speed; see `drive_core::flux::observer`.
    ObserverSettings "observer." [observer] {
        /// whether a back-EMF observer gives the angle at speed
        ///
        /// Without it the drive trips at [`tracked_rpm`](SynchronousTracking::tracked_rpm).
        enabled: bool = true, 62: word();
        /// fundamental-wave leakage at zero current, as a share of that of motor.*
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
        /// It limits the length of the current vector. With high flux it is the current of 155 % of the rated torque, between 1 and
        /// 1.6 times the rated current. The injection and the noise stay below the trip.
        current_a: Option<f32> = None, 66: auto("A", current_limit_a: |s| s.wanted_limit_a().min(s.limit_of_trip() * s.trip_a()))
            .beside(|s| (0.01, s.trip_a())).guarded(Guard::Lower);
        /// dc link above which the drive trips
        dc_over_v: Option<f32> = None, 67: auto("V", dc_over_v: |s| s.share_of_dc_link(400.0).min(WITHIN * s.dc_over_max_v()).min(0.95 * s.dc_link_range_v()))
            .beside(Settings::dc_over_range).hardware();
        /// dc link below which the drive trips while the outputs are on
        dc_under_v: Option<f32> = None, 68: auto("V", dc_under_v: |s| s.share_of_dc_link(200.0)).beside(Settings::dc_under_range).guarded(Guard::Raise);
        /// speed of the shaft that trips
        ///
        /// It is at most 500 Hz electrical: without an encoder the rotor angle is counted 1200 times a second, and the rotor may not
        /// move by more than half a turn in between.
        speed_rpm: Option<f32> = None, 69: auto("rpm", speed_trip_rpm: |s| 2000.0 / Nameplate::DEFAULT.speed_rpm * s.nameplate.speed_rpm)
            .beside(|s| (1.0, 500.0 / s.nameplate.frequency_hz * s.nameplate.speed_rpm)).guarded(Guard::Lower);
        /// largest unexplained voltage at standstill
        ///
        /// By rule it is an error of 26 % of the stator resistance at the current limit, plus 2.3 % of the dc link for the
        /// inverter voltage error; at most the dc link.
        unexplained_v: Option<f32> = None,
            70: auto("V", unexplained_v: |s| (0.26 * s.current_limit_a() * s.motor.r_s + s.share_of_dc_link(7.086)).min(s.inverter.dc_link_v)).from_to(0.01, 1000.0).guarded(Guard::Lower);
        /// continuous current of the motor at standstill, peak
        motor_a: Option<f32> = None, 71: auto("A", motor_a: |s| s.rated_a()).beside(|s| (0.01, 3.0 * s.rated_a())).guarded(Guard::Lower);
        /// thermal time constant of the windings
        ///
        /// The default lies between the time constants of the trip classes 10 and 20 (IEC 60947-4-1: 7.2 times the rated current for 10
        /// and 20 s mean 518 and 1037 s). A warm motor withstands 150 % of its torque for 60 s.
        motor_s: f32 = 600.0, 72: number("s").from_to(1.0, 10_000.0).guarded(Guard::Lower);
        /// continuous current of the inverter, peak
        inverter_a: Option<f32> = None, 73: auto("A", inverter_a: |s| s.current_limit_a()).beside(|s| (0.01, s.trip_a())).guarded(Guard::Lower);
        /// thermal time constant of the switches
        inverter_s: f32 = 5.0, 74: number("s").from_to(0.1, 1000.0).guarded(Guard::Lower);
        /// temperature of the heat sink that trips
        ///
        /// The default suits most power modules.
        heat_sink_c: f32 = 85.0, 75: number("degC").from_to(0.0, 150.0).hardware();
        /// heat-sink temperature above which the current limit falls, to zero at the trip
        derate_c: Option<f32> = None, 76: auto("degC", derate_c: |s| s.limits.heat_sink_c - 15.0).beside(|s| (-40.0, s.limits.heat_sink_c)).guarded(Guard::Lower);
        /// largest current from the dc link, motoring; 1000: none
        ///
        /// A limit lies above the copper losses of the d-axis current.
        dc_motoring_a: f32 = DcLimit::NONE.current_a, 126: number("A").beside(|s| (s.magnetising_w() / s.inverter.dc_link_v, DcLimit::NONE.current_a)).guarded(Guard::Lower);
        /// largest current into the dc link, generating; 1000: none
        dc_generating_a: f32 = DcLimit::NONE.current_a, 127: number("A").from_to(0.0, DcLimit::NONE.current_a).guarded(Guard::Lower);
        /// largest power from the dc link, motoring; 1e6: none
        motoring_w: f32 = DcLimit::NONE.power_w, 128: number("W").beside(|s| (s.magnetising_w(), DcLimit::NONE.power_w)).guarded(Guard::Lower);
        /// largest power into the dc link, generating; 1e6: none
        generating_w: f32 = DcLimit::NONE.power_w, 129: number("W").from_to(0.0, DcLimit::NONE.power_w).guarded(Guard::Lower);
    }

    /// The sequence between `start` and regulation, and at `stop`. Unset values follow [`rules`](super::rules).
    Sequence "sequence." [sequence] {
        /// time of the offset calibration
        calibrate_s: f32 = 0.1, 77: number("s").from_to(0.001, 10.0);
        /// time with the low sides on
        precharge_s: f32 = 0.010, 78: number("s").from_to(0.0, 10.0);
        /// time with d-axis current alone
        ///
        /// The flux is within 1 % after five rotor time constants. The lock monitor measures its baseline in this time, and with
        /// the saliency check also while the flux is restored.
        magnetise_s: Option<f32> = None, 79: auto("s", magnetise_s: |s| f32::max(0.8, 5.0 * s.motor.tau_r()))
            .beside(|s| (if s.watches_lock() && !s.injection.synchronous.check { 0.5 } else { 0.0 }, 60.0));
        /// flux of the rule for `sequence.i_d`: low as in the dissertation, or high
        flux: Flux = Flux::Low, 80: word().learned();
        /// magnetising (d-axis) current, peak
        ///
        /// 0.7 A is the current of section 3.10. With high flux it is the current of the rated flux, but at most 0.707 times the rated
        /// current and 0.707 times the current limit, which give the largest torque.
        i_d: Option<f32> = None, 81: auto("A", i_d: Settings::i_d_rule).beside(|s| (0.01, s.current_limit_a())).learned();
        /// fall of the q-axis current at a stop
        stop_a_per_s: Option<f32> = None, 82: auto("A/s", stop_a_per_s: |s| s.share_of_rated(30.0)).from_to(0.1, 1e5).guarded(Guard::Raise);
        /// whether a start first looks for a rotating shaft (flying start)
        ///
        /// The search takes 0.25 s and is done without an encoder only.
        flying_start: bool = Catch::IN_BUILD.is_some(), 83: word();
    }

    /// The choice of the flux; see `drive_core::current::voltage_limit`.
    FluxSettings "flux." [flux] {
        /// whether the flux is chosen for the least loss while there is no injection
        ///
        /// The flux is between half and all of the flux of `sequence.i_d`. A q-axis current then gives less torque, and a torque step for
        /// which the present flux is too small takes a rotor time constant.
        minimise_loss: bool = false, 84: word();
    }

    /// The speed loop, and the position loop around it. Unset values follow [`rules`](super::rules).
    SpeedSettings "speed." [speed] {
        /// largest q-axis current in speed and position mode
        i_q_limit_a: Option<f32> = None, 85: auto("A", i_q_limit_a: |s| 3.0 / 3.5 * s.current_limit_a()).beside(|s| (0.01, s.current_limit_a()));
        /// largest speed reference
        ///
        /// It holds in speed and position mode. With the observer, the rule gives the rated speed. The injection alone works up to
        /// 300 rpm with four poles. With an encoder the limit may be larger.
        limit_rpm: Option<f32> = None, 86: auto("rpm", speed_limit_rpm: |s| (if s.uses_observer() { s.nameplate.speed_rpm } else { s.share_of_poles(300.0) }).min(WITHIN * s.speed_trip_rpm()))
            .beside(|s| (1.0, s.speed_trip_rpm())).guarded(Guard::Lower);
        /// largest acceleration of the speed reference
        ramp_rpm_per_s: Option<f32> = None, 87: auto("rpm/s", ramp_rpm_per_s: |s| 300.0 / Nameplate::DEFAULT.speed_rpm * s.nameplate.speed_rpm).from_to(1.0, 1e5).guarded(Guard::Raise);
        /// deceleration of a quick stop
        quick_rpm_per_s: Option<f32> = None, 88: auto("rpm/s", quick_rpm_per_s: |s| 3.0 * s.ramp_rpm_per_s()).beside(|s| (s.ramp_rpm_per_s(), 3e5)).guarded(Guard::Raise);
        /// time for the acceleration to reach its full value, in speed mode and ramp stops; 0: at once
        s_ramp_s: f32 = 0.0, 89: number("s").from_to(0.0, 10.0).guarded(Guard::Lower);
        /// phase margin of the speed loop: more is calmer and slower; without an encoder 45 only with a stiff shaft
        ///
        /// Below 45 degrees the position loop, whose margin is about 12 degrees less, rings. The zero of the controller allows 76
        /// degrees at most.
        phase_margin_deg: f32 = 60.0, 90: number("deg").from_to(45.0, 70.0);
    }

    /// Limits of the torque by the voltage of the dc link, and the brake resistor; see `drive_core::dc_link`. Unset values follow
    /// [`rules`](super::rules). By default there is no brake resistor. If one is fitted, its energy and power are printed on it.
    BrakingSettings "braking." [braking] {
        /// dc link at which generating torque ends
        high_v: Option<f32> = None, 91: auto("V", dc_high_v: |s| s.share_of_dc_link(390.0).min(HIGH_OF_TRIP * s.dc_over_v()).min(WITHIN * s.highest_dc_link_v()))
            .beside(|s| (s.inverter.dc_link_v + MARGIN * s.inverter.dc_link_v, s.dc_over_v().min(s.highest_dc_link_v())));
        /// dc link below which kinetic buffering replaces motoring torque
        low_v: Option<f32> = None, 92: auto("V", dc_low_v: |s| f32::max(s.share_of_dc_link(260.0), LOW_OF_TRIP * s.dc_under_v()))
            .beside(|s| (s.dc_under_v() + MARGIN * s.dc_under_v(), s.inverter.dc_link_v - MARGIN * s.inverter.dc_link_v));
        /// d-axis current added while generating torque is limited; 0: none
        flux_a: Option<f32> = None, 93: auto("A", braking_flux_a: |s| f32::min(s.share_of_rated(1.0), WITHIN * s.current_limit_a()))
            .beside(|s| (0.0, s.current_limit_a()));
        /// brake resistor behind the chopper; 0 for none
        ohm: f32 = 0.0, 94: number("ohm").from_to(0.0, 1e5).guarded(Guard::Keep);
        /// energy that the cold brake resistor can absorb
        energy_j: f32 = 1000.0, 95: number("J").from_to(1.0, 1e7).guarded(Guard::Lower);
        /// continuous power of the brake resistor
        power_w: f32 = 50.0, 96: number("W").from_to(0.1, 1e5).guarded(Guard::Lower);
    }

    /// The supply of the dc link.
    SupplySettings "supply." [supply] {
        /// time of a steady dc link before the precharge relay closes; 0: no relay
        ///
        /// See `drive_core::supply`.
        relay_s: f32 = 0.0, 97: number("s").from_to(0.0, 60.0).guarded(Guard::Raise);
    }

    /// V/f control, for a motor that was not identified; see `drive_core::flux::volts_per_hertz`. Unset values
    /// follow [`rules`](super::rules).
    VoltsPerHertzMode "vf." [vf] {
        /// voltage between lines, rms, per frequency, in V/f control
        volts_per_hz: Option<f32> = None, 98: auto("V/Hz", volts_per_hz: |s| s.nameplate.voltage_v / s.nameplate.frequency_hz).from_to(0.01, 200.0);
        /// current at standstill in V/f control, peak
        ///
        /// The rule gives the magnetising current of most motors, 0.45 times the rated current.
        boost_a: Option<f32> = None, 99: auto("A", boost_a: |s| f32::min(0.45 * s.rated_a(), 0.6 * s.current_limit_a()))
            .beside(|s| (0.01, s.current_limit_a()));
        /// share of the slip that V/f control compensates
        slip_share: f32 = 1.0, 100: number().from_to(0.0, 1.5);
    }
}

/// Returns the setting with this name.
pub fn find(name: &str) -> Option<&'static Entry<Settings>> {
    SETTINGS.iter().find(|entry| entry.name == name)
}
