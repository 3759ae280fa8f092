//! Tests of the current sensors, the ADC and the encoder.

use std::f64::consts::TAU;

use drive_core::{Compare, Hardware};
use motor_plant::{
    Channel, Complex, CurrentFault, EncoderFault, InverterSettings, Load, MeasurementSettings,
    Plant, PlantSettings, Sensors, phases,
};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

const PERIOD: f64 = 1.0 / 6000.0;

fn rng() -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(11)
}

/// Returns the ADC counts of a steady current.
fn codes(settings: &MeasurementSettings, i: Complex) -> [u16; 2] {
    let mut sensors = Sensors::new(settings).expect("settings of the test");
    for _ in 0..100 {
        sensors.follow(i, i, PERIOD);
    }
    sensors.currents(&mut rng())
}

/// Space vector with these currents in phases a and b.
fn of_two_phases(a: f64, b: f64) -> Complex {
    Complex::new(a, (a + 2.0 * b) / 3f64.sqrt())
}

#[test]
fn codes_are_those_of_the_calibration_of_the_source() {
    let quiet = MeasurementSettings { noise_a: 0.0, ..Default::default() };
    // Table 4, measured; the lines of Eq. 3.5 fit it within five counts.
    let table = [
        (-3.0, 666, 671),
        (-2.0, 1117, 1118),
        (-1.0, 1567, 1566),
        (0.0, 2024, 2016),
        (1.0, 2478, 2463),
        (2.0, 2927, 2916),
        (3.0, 3375, 3356),
    ];
    for (i, a, b) in table {
        let [code_a, code_b] = codes(&quiet, of_two_phases(i, i));
        assert!(code_a.abs_diff(a) <= 5 && code_b.abs_diff(b) <= 5, "{i} A: {code_a} {code_b}");
    }
}

#[test]
fn the_calibration_lines_undo_the_codes() {
    for lsb_a in [0.002_212, 0.000_14, 0.000_553, 0.05] {
        let settings = MeasurementSettings { noise_a: 0.0, lsb_a, ..Default::default() };
        let lines = settings.calibration();
        assert_eq!(lines[0].full_scale, (4095.0f64 * 0.002_212 / lsb_a).round() as u16);
        for i in [-4.0, -1.234, 0.0, 0.7, 4.3] {
            let codes = codes(&settings, of_two_phases(i, -i));
            for (k, i) in [i, -i].into_iter().enumerate() {
                let line = lines[k];
                let read = f64::from(codes[k]) * line.a_per_code + line.a_at_zero;
                // The tolerance is slightly more than half a count of rounding.
                assert!((read - i).abs() < 0.5001 * line.a_per_code, "{lsb_a}: {read} for {i} A");
            }
        }
        let ends = [codes(&settings, of_two_phases(9.0, -9.0)), codes(&settings, (-9.0).into())];
        assert_eq!(ends[0], [lines[0].full_scale, 0], "clipped");
        assert_eq!(ends[1][0], 0, "clipped");
    }
    let (default, ratio) = (MeasurementSettings::default().calibration(), 0.002_231_4 / 0.002_212);
    assert_eq!(default[0].full_scale, 4095);
    let finer = MeasurementSettings { lsb_a: 0.001, ..Default::default() }.calibration();
    assert!((finer[1].a_per_code - 0.001 * ratio).abs() < 1e-12);
}

#[test]
fn gain_error_and_offset_show() {
    let settings = MeasurementSettings {
        gain_error_a: 0.01,
        gain_error_b: -0.02,
        offset_a: 0.02,
        offset_b: -0.03,
        ..MeasurementSettings::IDEAL
    };
    let read = codes(&settings, of_two_phases(2.0, 1.0));
    for (k, expected) in [2.04, 0.95].into_iter().enumerate() {
        let line = settings.calibration()[k];
        let current = f64::from(read[k]) * line.a_per_code + line.a_at_zero;
        assert!((current - expected).abs() < 1e-4, "{current} A, not {expected}");
    }
}

#[test]
fn noise_has_its_size_and_no_correlation() {
    let settings = MeasurementSettings { noise_a: 0.005, ..MeasurementSettings::IDEAL };
    let sensors = Sensors::new(&settings).expect("settings");
    let (lines, mut rng) = (settings.calibration(), rng());
    let n = 40_000;
    let (mut sums, mut squares, mut product) = ([0.0; 2], [0.0; 2], 0.0);
    for _ in 0..n {
        let codes = sensors.currents(&mut rng);
        let read: [f64; 2] =
            std::array::from_fn(|k| f64::from(codes[k]) * lines[k].a_per_code + lines[k].a_at_zero);
        for k in 0..2 {
            sums[k] += read[k];
            squares[k] += read[k] * read[k];
        }
        product += read[0] * read[1];
    }
    let n = f64::from(n);
    for k in 0..2 {
        let (mean, rms) = (sums[k] / n, (squares[k] / n).sqrt());
        // Four standard deviations of each estimate: 0.02 rms, and 1.4 % of the rms.
        assert!(mean.abs() < 4.0 * 0.005 / n.sqrt(), "mean {mean}");
        assert!((rms / 0.005 - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "rms {rms}");
    }
    let correlation = product / n / 0.005f64.powi(2);
    assert!(correlation.abs() < 4.0 / n.sqrt(), "correlation {correlation}");
}

#[test]
fn the_analog_filter_lags_by_6_5_degrees_at_600_hz() {
    for substeps in [1u32, 2, 24] {
        let settings = MeasurementSettings { filter_hz: 5305.0, ..MeasurementSettings::IDEAL };
        let mut sensors = Sensors::new(&settings).expect("settings");
        let per_cycle = 10 * substeps;
        let h = PERIOD / f64::from(substeps);
        let current = |n: u32| 2.0 * (TAU * f64::from(n) / f64::from(per_cycle)).cos();
        let line = settings.calibration()[0];
        let mut phasor = Complex::ZERO;
        for n in 0..40 * per_cycle {
            sensors.follow(current(n).into(), current(n + 1).into(), h);
            if n >= 10 * per_cycle {
                let read = f64::from(sensors.currents(&mut rng())[0]) * line.a_per_code;
                let turn = TAU * f64::from(n + 1) / f64::from(per_cycle);
                phasor += Complex::from_polar((read + line.a_at_zero) / 2.0, -turn);
            }
        }
        let lag = -phasor.arg().to_degrees();
        let gain = phasor.norm() / (15.0 * f64::from(per_cycle));
        // atan(600/5305). The straight pieces have the phase of the cosine but, at ten a cycle, only sinc(1/10)^2 =
        // 0.967 of its size (their images alias back and add a little).
        let expected = (600.0f64 / 5305.0).atan().to_degrees();
        assert!((expected - 6.45).abs() < 0.01);
        let tolerance = if substeps == 1 { 0.5 } else { 0.1 };
        assert!((lag - expected).abs() < tolerance, "{substeps}: {lag} degrees");
        let exact = 1.0 / 1f64.hypot(600.0 / 5305.0);
        assert!(
            (gain / exact - 1.0).abs() < 0.04 / f64::from(substeps * substeps) + 1e-4,
            "{gain}"
        );
    }
}

#[test]
fn without_filter_the_current_is_read_at_once() {
    let mut sensors = Sensors::new(&MeasurementSettings::IDEAL).expect("settings");
    sensors.follow(Complex::ZERO, Complex::new(1.0, 0.0), PERIOD);
    let line = MeasurementSettings::IDEAL.calibration()[0];
    let read = f64::from(sensors.currents(&mut rng())[0]) * line.a_per_code + line.a_at_zero;
    assert!((read - 1.0).abs() < line.a_per_code, "{read}");
}

fn running(seed: u64) -> Plant {
    let mut plant = Plant::new(&PlantSettings::default(), seed).expect("settings");
    let compare = Compare { a: 8500, b: 6900, c: 6900, enabled: true };
    (0..200).for_each(|_| plant.advance(&compare, PERIOD));
    plant
}

#[test]
fn equal_seeds_give_equal_samples() {
    let (mut one, mut same, mut other) = (running(5), running(5), running(6));
    let samples: Vec<_> = (0..200).map(|_| one.sample()).collect();
    assert!(samples.iter().all(|s| *s == same.sample()));
    assert!(samples.iter().any(|s| *s != other.sample()));
    assert_eq!(one.current(), other.current(), "only the noise is random");
}

#[test]
fn faulty_channels_read_what_they_should() {
    let mut plant = running(5);
    let [a, b, _] = plant.phase_currents();
    assert!(a > 0.5 && b < -0.2, "{a} {b}");
    let near = |code: u16, expected: u16| code.abs_diff(expected) < 15;
    plant.set_current_fault(Channel::A, CurrentFault::Open);
    let sample = plant.sample();
    assert!(near(sample.current_a, 2022) && !near(sample.current_b, 2015), "{sample:?}");
    plant.set_current_fault(Channel::A, CurrentFault::Stuck(1234));
    plant.set_current_fault(Channel::B, CurrentFault::SaturatedHigh);
    let sample = plant.sample();
    assert_eq!((sample.current_a, sample.current_b), (1234, 4095));
    plant.set_current_fault(Channel::A, CurrentFault::SaturatedLow);
    plant.set_current_fault(Channel::B, CurrentFault::None);
    let sample = plant.sample();
    assert_eq!(sample.current_a, 0);
    assert!(near(sample.current_b, ((b + 4.496_623_8) / 0.002_231_4).round() as u16));
}

#[test]
fn the_other_channels() {
    let mut plant = running(5);
    // 311 V at 0.11 V per count.
    assert_eq!((plant.sample().dc_link, plant.sample().heat_sink), (2827, 1309));
    plant.set_dc_link(500.0).expect("voltage");
    plant.set_heat_sink(77);
    assert_eq!((plant.sample().dc_link, plant.sample().heat_sink), (4095, 77));
    assert!(plant.set_dc_link(f64::NAN).is_err() && plant.dc_link() == 500.0);
    plant.report(Hardware::BREAK);
    plant.report(Hardware::DEADLINE_MISS);
    assert_eq!(plant.sample().hardware, Hardware::BREAK.union(Hardware::DEADLINE_MISS));
    assert_eq!(plant.sample().hardware, Hardware::empty(), "reported once");
}

#[test]
fn the_encoder_counts_quarter_lines_both_ways_and_wraps() {
    // Ten turns in 6000 periods.
    let speed = 10.0 * TAU;
    let mut settings = PlantSettings { inverter: InverterSettings::IDEAL, ..Default::default() };
    settings.mechanics.load = Load::Speed { speed };
    let mut plant = Plant::new(&settings, 1).expect("settings");
    let turn = |plant: &mut Plant| (0..6000).for_each(|_| plant.advance(&Compare::OFF, PERIOD));
    assert_eq!(plant.sample().encoder, 0);
    turn(&mut plant);
    // Within one count of rounding.
    assert!(plant.sample().encoder.abs_diff(100_000) <= 1, "{}", plant.sample().encoder);
    plant.set_load(Load::Speed { speed: -speed }).expect("speed");
    turn(&mut plant);
    plant.advance(&Compare::OFF, PERIOD);
    // 16.7 counts backwards from zero: down to -17, wrapped.
    let below = plant.sample().encoder.wrapping_neg();
    assert!((17..=18).contains(&below), "{below}");

    plant.set_encoder_fault(EncoderFault::Stuck);
    turn(&mut plant);
    assert_eq!(plant.sample().encoder.wrapping_neg(), below, "stuck");
    plant.set_encoder_fault(EncoderFault::Losing(0.25));
    turn(&mut plant);
    let moved = plant.sample().encoder.wrapping_neg() - below;
    assert!(moved.abs_diff(75_000) <= 1, "{moved}");
    plant.set_encoder_fault(EncoderFault::None);
    turn(&mut plant);
    let moved = plant.sample().encoder.wrapping_neg() - below;
    assert!(moved.abs_diff(175_000) <= 1, "goes on from there: {moved}");
}

#[test]
fn loads_hold_release_and_brake_the_shaft() {
    let mut plant = Plant::new(&PlantSettings::default(), 1).expect("settings");
    plant.set_load(Load::Speed { speed: 20.0 }).expect("speed");
    plant.advance(&Compare::OFF, PERIOD);
    assert_eq!(plant.mechanical_speed(), 20.0);
    // The free shaft slows down by load torque and friction: (0.3 + 0.001 w)/0.012.
    plant.set_load(Load::Free { torque: 0.3 }).expect("torque");
    (0..600).for_each(|_| plant.advance(&Compare::OFF, PERIOD));
    let rate = 0.001 / 0.012;
    let expected = (20.0 + 300.0) * f64::exp(-rate * 0.1) - 300.0;
    assert!((plant.mechanical_speed() - expected).abs() < 1e-9, "{}", plant.mechanical_speed());
    plant.set_load(Load::Locked).expect("lock");
    let angle = plant.mechanical_angle();
    plant.advance(&Compare::OFF, PERIOD);
    assert_eq!((plant.mechanical_speed(), plant.mechanical_angle()), (0.0, angle));
    let [a, b, c] = phases(plant.current());
    assert_eq!((a, b, c), (0.0, 0.0, 0.0));
}
