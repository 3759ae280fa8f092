//! Tests of the inverter: averaged against switched, dead time, delay, and the integration steps.

use std::f64::consts::TAU;

use crate::common::{T, behind, compare, plant};
use crate::duties::{TOP, duties};
use drive_core::Compare;
use motor_plant::{Complex, InverterSettings, Load, PlantSettings, clarke, phases};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Runs 0.2 s with these duty cycles; returns the current, and the voltage of the last period.
fn settled(inverter: InverterSettings, d: [f64; 3]) -> (Complex, Complex) {
    let mut plant = plant(&behind(inverter));
    let compare = duties(d);
    for _ in 0..1200 {
        plant.advance(&compare, T);
    }
    (plant.current(), plant.applied_voltage())
}

#[test]
fn averaged_and_switched_agree_on_the_mean_voltage() {
    let averaged = InverterSettings::default();
    let switched = InverterSettings { switched: true, ..averaged };
    // Large currents of either direction; legs that do not switch; a pulse and a gap (0.5 us) shorter than the dead
    // time.
    for d in [
        [0.56, 0.48, 0.46],
        [0.43, 0.54, 0.56],
        [0.08, 0.0, 0.0],
        [1.0, 0.9, 0.91],
        [0.12, 0.01, 0.003],
        [0.88, 0.99, 0.997],
    ] {
        let (i, v) = settled(averaged, d);
        let (i_switched, v_switched) = settled(switched, d);
        assert!(phases(i).iter().all(|i| i.abs() > 0.1), "{i}: phases well off zero");
        // The edges are the same, and all currents keep their sign through the ripple: only rounding remains.
        assert!((v - v_switched).norm() < 1e-6, "{d:?}: {v} against {v_switched}");
        // The pulses are symmetrical about the sampling instant. Apart from the delay and half the dead time the ripple
        // therefore crosses zero there: 3.3 us of the voltage applied then, at most 207 V (one leg always high), on 51
        // mH are 13 mA.
        assert!((i - i_switched).norm() < 0.014, "{d:?}: {i} against {i_switched}");
    }
}

#[test]
fn short_pulses_and_gaps_vanish() {
    for switched in [false, true] {
        // Pulses of 0.5, 0.7 and 0.8 us, and gaps of the same lengths, are all shorter than the dead time. With i_a > 0
        // > i_b, i_c, phase a loses its pulse while b and c gain the dead time. In the gaps, a loses the dead time
        // while b and c lose their gaps.
        for (d, expected) in [
            ([0.003, 0.004, 0.005], [0.0, 0.004 + 0.0132, 0.005 + 0.0132]),
            ([0.997, 0.996, 0.995], [0.997 - 0.0132, 1.0, 1.0]),
        ] {
            let inverter = InverterSettings { switched, residual_v: 0.0, ..Default::default() };
            let mut plant = plant(&behind(inverter));
            for _ in 0..1200 {
                plant.advance(&duties([0.56, 0.48, 0.46]), T);
            }
            // Two periods, because the first still contains the delayed part of the previous period.
            plant.advance(&duties(d), T);
            plant.advance(&duties(d), T);
            let error = plant.applied_voltage() - clarke(expected.map(|d| 311.0 * d));
            // Compare values are whole numbers: 22 mV.
            assert!(error.norm() < 0.03, "switched {switched}, {d:?}: off by {error} V");
        }
    }
}

#[test]
fn the_dead_time_takes_4_1_volts() {
    let with = InverterSettings { residual_v: 0.0, ..Default::default() };
    for (switched, pulses) in [(false, 1), (true, 1), (false, 2), (true, 2), (false, 3), (true, 3)]
    {
        let d = [0.56, 0.47, 0.47];
        // The number of counts per pulse is the same for any number of pulses.
        let alike = InverterSettings { switched, pulses, timer_top: pulses * TOP, ..with };
        let (_, v) = settled(alike, d);
        let (_, v0) = settled(InverterSettings { dead_time_us: 0.0, ..alike }, d);
        // Phase a loses e, b and c gain e: 4/3 e along alpha. Each pulse has its own dead time.
        let e = 0.75 * (v0 - v).re / f64::from(pulses);
        assert!((e - 311.0 * 2.2 / 166.667).abs() < 1e-3, "{switched} {pulses}: {e} V");
        assert!((e - 4.1).abs() < 0.01 && (v0 - v).im.abs() < 1e-6, "{e} {v0} {v}");
        // Legs that do not switch have no error.
        let d = [1.0, 0.0, 0.0];
        let short = |s: InverterSettings| {
            let mut plant = plant(&behind(InverterSettings { switched, vdc: 20.0, ..s }));
            (0..600).for_each(|_| plant.advance(&duties(d), T));
            plant.applied_voltage()
        };
        assert!((short(with) - Complex::new(20.0 * 2.0 / 3.0, 0.0)).norm() < 1e-9);
    }
}

#[test]
fn the_delay_shifts_the_voltage() {
    // After a step of the voltage, the next period contains the delayed part of the old voltage.
    for switched in [false, true] {
        let ideal = InverterSettings { switched, ..InverterSettings::IDEAL };
        let delayed = InverterSettings { propagation_us: 2.2, ..ideal };
        let mut plant = plant(&behind(delayed));
        plant.advance(&Compare::LOW_SIDES_ON, T);
        plant.advance(&duties([0.6, 0.5, 0.5]), T);
        let v = plant.applied_voltage().re;
        let full = 311.0 * 0.1 * 2.0 / 3.0;
        // With switching edges the pulses lie well inside the period and only shift; averaged, 1.32 % moves to the next period.
        let expected = if switched { full } else { full * (1.0 - 2.2 / 166.667) };
        // Compare values are whole numbers: 311 V/14167 = 22 mV.
        assert!((v - expected).abs() < 0.02, "{switched}: {v} V instead of {expected}");
    }
}

/// Largest difference between the currents of two plants at the sampling instants, A, with a rotating voltage and an
/// injected voltage, on a free shaft.
fn worst_difference(one: &PlantSettings, other: &PlantSettings) -> f64 {
    let (mut one, mut other) = (plant(one), plant(other));
    let mut worst = 0f64;
    for k in 0..6000 {
        let t = f64::from(k) * T;
        let v = Complex::from_polar(25.0, TAU * 8.0 * t)
            + Complex::from_polar(50.0 * (TAU * 600.0 * t).cos(), TAU * 8.0 * t);
        let compare = compare(v);
        one.advance(&compare, T);
        other.advance(&compare, T);
        worst = worst.max((one.current() - other.current()).norm());
    }
    assert!(one.mechanical_speed().abs() > 1.0, "it turns: {}", one.mechanical_speed());
    worst
}

#[test]
fn two_substeps_are_enough() {
    let mut coarse = behind(InverterSettings::default());
    coarse.mechanics.load = Load::Free { torque: 0.05 };
    let fine = PlantSettings { substeps: 24, ..coarse };
    let worst = worst_difference(&coarse, &fine);
    let one = worst_difference(&PlantSettings { substeps: 1, ..coarse }, &fine);
    // The difference is far below the ADC's 2.2 mA. It comes from a kink that is crossed slightly off the predicted
    // instant, and from the fifth order of 5570 rad/s (the slope of the smoothed sign) times T/2.
    assert!(worst < 1e-5, "{worst:e} A");
    assert!(one < 1e-4, "{one:e} A");
}

#[test]
fn averaged_and_switched_currents_stay_together() {
    let mut averaged = behind(InverterSettings { residual_v: 0.0, ..Default::default() });
    averaged.mechanics.load = Load::Free { torque: 0.05 };
    let mut switched = averaged;
    switched.inverter.switched = true;
    let worst = worst_difference(&averaged, &switched);
    // When a current passes zero the two differ by up to the dead-time error, because its sign then depends on the
    // ripple, which the average does not contain.
    assert!(worst < 0.1, "{worst} A");
}

#[test]
fn any_sequence_of_commands_keeps_the_state_finite() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    for switched in [false, true] {
        let mut s = behind(InverterSettings { switched, ..Default::default() });
        s.mechanics.load = Load::Free { torque: 0.0 };
        s.saliency.chi = 1.0;
        let mut plant = plant(&s);
        for k in 0..20_000 {
            let mut compare = || match rng.random_range(0..5) {
                0 => 0,
                1 => TOP,
                2 => u16::MAX,
                _ => rng.random_range(0..=TOP),
            };
            let (a, b, c) = (compare(), compare(), compare());
            let enabled = rng.random_bool(0.7);
            plant.advance(&Compare { a, b, c, enabled }, T);
            assert!(plant.current().norm() < 60.0, "period {k}: {}", plant.current());
            assert!(plant.rotor_flux().is_finite() && plant.mechanical_speed().is_finite());
            if k % 1000 == 0 {
                plant.set_dc_link(rng.random_range(0.0..400.0)).expect("voltage");
            }
        }
    }
}
