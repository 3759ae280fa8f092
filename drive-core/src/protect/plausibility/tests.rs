//! Tests of the plausibility checks.
#![allow(clippy::disallowed_methods)] // std functions are the reference here
use super::*;
use crate::{Abc, Angle};

/// Returns an injection current of 0.26 A, 30° behind its voltage, as sensors with these gains measure it on the axis.
fn seen(axis: UnitVector, gain_a: f32, gain_b: f32) -> CarrierCurrent {
    let component = |amplitude: f32| {
        let Abc { a, b, .. } = AlphaBeta::along(axis, amplitude).to_abc();
        AlphaBeta::from_two_phases(gain_a * a, gain_b * b).seen_from(axis)
    };
    let (re, im) = (component(0.26 * 0.866), component(-0.26 * 0.5));
    CarrierCurrent { along: (re.0, im.0), across: (re.1, im.1) }
}

/// Returns the injection period in which a fault is reported, and the fault.
fn watched(degrees: f32, gain_a: f32, gain_b: f32) -> Option<(usize, Fault)> {
    let axis = Angle::from_degrees(degrees).unit_vector();
    let mut watch = CarrierWatch::default();
    (1..100).find_map(|n| {
        watch.step(seen(axis, gain_a, gain_b), axis, 0.26).err().map(|fault| (n, fault))
    })
}

#[test]
fn a_channel_below_a_quarter_of_its_carrier_is_silent() {
    // Two periods are for settling, and three until the fault.
    let (a, b) = (Some((5, Fault::CarrierMissingA)), Some((5, Fault::CarrierMissingB)));
    for degrees in [60.0, -120.0, 64.0] {
        assert_eq!(watched(degrees, 1.0, 1.0), None);
        assert_eq!(watched(degrees, 0.26, 0.26), None);
        assert_eq!(watched(degrees, 0.24, 1.0), a, "{degrees}");
        assert_eq!(watched(degrees, 1.0, 0.24), b, "{degrees}");
        assert_eq!(watched(degrees, 0.0, 0.0), a, "{degrees}");
    }
    // Across the phase of a sensor no injection current is expected; 0.4 of it is reached at 66.4°.
    for (degrees, judged) in [(90.0, false), (67.0, false), (66.0, true), (113.0, false)] {
        assert_eq!(watched(degrees, 0.0, 1.0).is_some(), judged, "{degrees}");
        assert_eq!(watched(120.0 - degrees, 1.0, 0.0).is_some(), judged, "{degrees}");
    }
    assert_eq!(watched(0.0, 1.0, 0.0), b);
}

#[test]
fn a_channel_must_be_silent_in_a_row() {
    let axis = Angle::from_degrees(60.0).unit_vector();
    let mut watch = CarrierWatch::default();
    for n in 0..100 {
        let gain = if n % 3 == 0 { 1.0 } else { 0.0 };
        assert_eq!(watch.step(seen(axis, gain, gain), axis, 0.26), Ok(()));
    }
}

const PLANT: FirstOrder = FirstOrder { k: 0.003_205_2, p: 0.980_053 };
/// Speeds, electrical turns per period: 600 and 630 rpm with two pole pairs.
const ROTOR: f32 = 20.0 / 6000.0;
const FLUX: f32 = 21.0 / 6000.0;

/// Returns the unexplained voltage, V, of the motor with its rotor at [`ROTOR`], a rotating applied
/// voltage, and `more` unknown volts along phase a; and the time of the fault. The drive estimates the
/// share `believed` of the speed of the rotor.
fn unexplained(more: f32, believed: f32) -> (AlphaBeta, Option<u32>) {
    let motor = Motor::default();
    // The mean in the flux frame is not judged.
    let prediction = Prediction::new(&motor, PLANT, 15.0, [1e3; 2]);
    let (rest, fault) = run(&prediction, more, believed, 1.0);
    assert!(fault.is_none_or(|(_, fault)| fault == Fault::CurrentNotAsPredicted));
    (rest, fault.map(|(n, _)| n))
}

/// Runs as [`unexplained`] and returns the fault too. The motor has the share `flux` of the estimated rotor flux.
fn run(
    prediction: &Prediction,
    more: f32,
    believed: f32,
    flux: f32,
) -> (AlphaBeta, Option<(u32, Fault)>) {
    let motor = Motor::default();
    let (mut state, mut current) = (PredictionState::default(), AlphaBeta::ZERO);
    let (k_g, pole) = (PLANT.k as f32, PLANT.p as f32);
    let (mut acting, mut pending) = (AlphaBeta::ZERO, AlphaBeta::ZERO);
    let coupled = motor.coupled_inductance();
    let coupled = coupled * flux;
    let of_flux =
        Dq { d: coupled * 0.7 / motor.tau_r(), q: -coupled * 0.7 * ROTOR * TAU / PERIOD_S };
    for n in 0..3000_u32 {
        let axis = |k: f32| Angle::from_turns(k * FLUX % 1.0).unit_vector();
        state.collect(current, pending);
        match n % 10 {
            1 | 6 => state.latch_voltage(),
            2 | 7 => prediction.predict(
                &mut state,
                &RotorFlux {
                    magnetising: 0.7,
                    rotor_freq: believed * ROTOR,
                    axis: axis(n as f32),
                    flux_freq: FLUX,
                },
            ),
            3 | 8 => {
                if let Err(fault) = prediction.judge(&mut state, current, Uncertainty::default()) {
                    return (state.unexplained, Some((n, fault)));
                }
            }
            _ => {}
        }
        let emf = of_flux.to_alpha_beta(axis(n as f32 + 0.5));
        let total = acting + emf + AlphaBeta::new(more, 0.0);
        current = current * pole + total * k_g;
        acting = pending;
        pending = Dq::new(4.0, 20.0).to_alpha_beta(axis(n as f32 + 2.5));
    }
    (state.unexplained, None)
}

/// Returns the back-EMF of the rotor flux, V.
fn emf() -> f32 {
    Motor::default().coupled_inductance() * 0.7 * TAU * 20.0
}

#[test]
fn applied_voltage_and_rotor_explain_the_current() {
    let (rest, fault) = unexplained(0.0, 1.0);
    assert_eq!(fault, None);
    assert!(rest.length_squared() < 0.1 * 0.1, "{rest:?} of {}", emf());
    let (rest, fault) = unexplained(3.0, 1.0);
    assert!(fault.is_none() && (rest - AlphaBeta::new(3.0, 0.0)).length_squared() < 0.01);
}

#[test]
fn a_flux_that_is_gone_is_seen_in_the_mean_of_its_voltage() {
    // The dissertation's motor has 12 V, and in the mean 6 V beside half of the back-EMF of 13 V.
    let prediction = Prediction::new(&Motor::default(), PLANT, 12.0, [6.0, 3.0]);
    for (flux, seen) in [(1.0, false), (0.5, false), (0.0, true), (-1.0, true), (2.2, true)] {
        let (_, fault) = run(&prediction, 0.0, 1.0, flux);
        assert_eq!(fault.is_some(), seen, "{flux}: {fault:?} of {}", emf());
    }
    // The time is 50 ms ln(1 / (1 - share)) with the allowed voltage as a share of the back-EMF.
    let (_, fault) = run(&prediction, 0.0, 1.0, -0.05);
    let (n, fault) = fault.unwrap();
    assert_eq!(fault, Fault::FluxNotAsPredicted);
    let share = (6.0 + 0.5 * emf() * FLUX / ROTOR) / (1.05 * emf());
    let expected = -0.050 * 6000.0 * (1.0 - share).ln();
    assert!((n as f32 / expected - 1.0).abs() < 0.2, "{n} for {expected}");
}

/// When the flux has built up without torque, half of the back-EMF and a tenth of the allowed mean may be missing.
#[test]
fn a_back_emf_that_is_missing_is_seen_with_either_sign() {
    let prediction = Prediction::new(&Motor::default(), PLANT, 12.0, [6.0, 3.0]);
    for emf in [0.0_f32, 4.0, -4.0, 20.0, -20.0] {
        let most = 0.5 * emf.abs() + 0.3;
        let sees = |missing: f32| {
            let mean = Dq::new(5.0, missing * if emf < 0.0 { -1.0 } else { 1.0 });
            let flux = (Angle::ZERO.unit_vector(), emf);
            prediction.sees_flux(&PredictionState { mean, flux, ..PredictionState::default() })
        };
        assert!(sees(0.99 * most) && sees(-20.0) && !sees(1.01 * most), "{emf}");
        assert!(!sees(f32::NAN));
    }
}

/// A warm stator is assumed to be cold: 30 % of 5.4 ohm at 2 A are 3.2 V, more than the limit with a tracked resistance.
#[test]
fn the_resistance_that_is_tracked_is_reckoned_with() {
    let prediction = Prediction::new(&Motor::default(), PLANT, 12.0, [6.0, 3.0]);
    let current = AlphaBeta::new(2.0, 0.0);
    let judged = |known: Uncertainty| {
        let mut state = PredictionState { last: current, ..PredictionState::default() };
        // These are the voltages of the cold motor's model and of the warm motor.
        let cold = current * ((1.0 - PLANT.p) / PLANT.k) as f32;
        let warm = cold + current * (0.3 * Motor::default().r_s);
        (0..600).try_for_each(|_| {
            (0..JUDGED_EVERY).for_each(|_| state.collect(current, warm));
            state.latch_voltage();
            prediction.judge(&mut state, current, known)
        })
    };
    let fault = Err(Fault::FluxNotAsPredicted);
    assert_eq!(judged(Uncertainty { deviation: 0.0, tracked: false, building: false }), Ok(()));
    assert_eq!(judged(Uncertainty { deviation: 0.0, tracked: true, building: false }), fault);
    assert_eq!(judged(Uncertainty { deviation: 0.3, tracked: true, building: false }), Ok(()));
}

#[test]
fn voltage_beyond_the_allowed_one_and_the_back_emf_is_a_fault() {
    // The squares of 15 V and of half of the back-EMF add.
    let most = (15.0 * 15.0 + 0.25 * emf() * emf()).sqrt();
    assert_eq!(unexplained(0.98 * most, 1.0).1, None);
    assert!(unexplained(1.02 * most, 1.0).1.is_some());
    // If the estimated speed is zero, the back-EMF is unexplained and does not widen the bound.
    let (rest, fault) = unexplained(0.0, 0.0);
    assert_eq!(fault.is_some(), emf() > 15.0);
    // A mean of 2.6 ms passes 95 % of a voltage that rotates at 21 Hz.
    assert!((rest.length_squared().sqrt() / emf() - 0.947).abs() < 0.01, "{rest:?}");
    assert!(unexplained(f32::NAN, 1.0).1.is_some());
}
