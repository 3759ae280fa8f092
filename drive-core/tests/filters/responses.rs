//! Tests of the responses: transfer functions as printed, gains, delays.

use core::f64::consts::PI;

use induction_drive_core::filter::{
    BPF, LPF, LPF_AS_PRINTED, PP, Section, Sos, SosState, lpf_lag_samples, response,
};
use num_complex::Complex64;

use super::db;
use super::printed::{TABLE_7_LPF, TABLE_8_BPF, TABLE_8_PP};
use super::{is_stable, largest_distance, rad};

#[test]
fn sections_have_the_printed_transfer_functions() {
    let lpf = largest_distance(|w| LPF_AS_PRINTED.response(w), |w| TABLE_7_LPF.response(w));
    let bpf = largest_distance(|w| BPF.response(w), |w| TABLE_8_BPF.response(w));
    let pp = largest_distance(|w| PP.response(w), |w| TABLE_8_PP.response(w));
    assert!(lpf < 3.5e-6 && bpf < 1.5e-6 && pp < 6e-6, "{lpf} {bpf} {pp}");
    assert!(LPF_AS_PRINTED.sections.iter().chain(&LPF.sections).all(is_stable));
    assert!(BPF.sections.iter().chain(&PP.sections).all(is_stable));
}

#[test]
fn gains() {
    for (name, gain, printed) in [
        ("LPF", LPF_AS_PRINTED.dc_gain(), 0.94406),
        ("BPF", BPF.dc_gain(), 0.01000),
        ("PP", PP.dc_gain(), 0.94406),
    ] {
        assert!((gain - printed).abs() < 1e-4, "{name}: {gain}");
    }

    let w = rad(600.0);
    let (lpf, unit) = (db(LPF_AS_PRINTED.response(w)), db(LPF.response(w)));
    assert!(lpf <= -48.0 && (lpf + 48.29).abs() < 0.01, "{lpf} dB");
    assert!((unit + 47.79).abs() < 0.01, "{unit} dB");
    let bpf = BPF.response(w);
    assert!((db(bpf) + 0.490).abs() < 0.001 && (bpf.arg().to_degrees() + 3.86).abs() < 0.01);
    assert!((db(PP.response(w)) + 75.83).abs() < 0.01);
    assert!((db(PP.response(rad(1200.0))) + 62.73).abs() < 0.01);
    // The band stop passes everything above 650 Hz, so it is no anti-alias filter.
    assert!((db(LPF_AS_PRINTED.response(PI)) + 0.5).abs() < 0.001);
}

#[test]
fn lpf_has_unit_gain_at_dc() {
    let error = LPF.dc_gain() - 1.0;
    // The error is the rounding of the last section, whose zeros nearly cancel at dc.
    assert!(error.abs() < 3e-7, "{error}");
    assert!((LPF.response(rad(60.0)).norm() - 1.00125).abs() < 1e-5);
    // Poles and zeros are unchanged.
    let scaled = |w| LPF_AS_PRINTED.response(w) * (1.0 / LPF_AS_PRINTED.dc_gain());
    assert!(largest_distance(|w| LPF.response(w), scaled) < 3e-6);

    // Therefore the output settles at the input, except for the noise of f32.
    let mut state = SosState::default();
    let mut y = 0.0;
    for _ in 0..20_000 {
        y = LPF.step(&mut state, 3.0);
    }
    assert!((y - 3.0).abs() < 1e-5, "{y} A");
}

/// Returns the group delay -d arg H / d(ωT) of a cascade, samples.
fn group_delay(sections: &[Section], omega_t: f64) -> f64 {
    let h = 1e-5;
    -(response(sections, omega_t + h) / response(sections, omega_t - h)).arg() / (2.0 * h)
}

#[test]
fn group_delays() {
    for (name, delay, printed) in [
        ("LPF at dc", group_delay(&LPF.sections, 0.0), 1.53),
        ("LPF at 200 Hz", group_delay(&LPF.sections, rad(200.0)), 2.46),
        ("BPF at dc", group_delay(&BPF.sections, 0.0), 0.80),
        ("BPF at 600 Hz", group_delay(&BPF.sections, rad(600.0)), 8.83),
        ("PP at dc", group_delay(&PP.sections, 0.0), 24.46),
        ("PP at 200 Hz", group_delay(&PP.sections, rad(200.0)), 4.0),
    ] {
        assert!((delay - printed).abs() < 0.006, "{name}: {delay}");
    }
}

#[test]
fn lag_of_lpf_up_to_60_hz() {
    let error_deg = |hz: f64| {
        let w = rad(hz);
        let lag = f64::from(lpf_lag_samples(w as f32)) * w;
        (lag + LPF.response(w).arg()) * (180.0 / PI)
    };
    let worst = (1..=600).map(|n| error_deg(f64::from(n) / 10.0).abs()).fold(0.0, f64::max);
    assert!(worst < 2e-4, "{worst} degrees");
    assert!(error_deg(100.0).abs() < 0.01 && error_deg(200.0).abs() < 0.5);
    assert_eq!(lpf_lag_samples(-0.05), lpf_lag_samples(0.05));
}

#[test]
fn responses_of_trivial_cascades() {
    assert_eq!(response(&[], 1.0), Complex64::ONE);
    let delay = Sos { sections: [Section { b0: 0.0, b1: 1.0, ..Section::IDENTITY }] };
    assert!((delay.response(0.3) - Complex64::cis(-0.3)).norm() < 1e-15);
    assert!((group_delay(&delay.sections, 0.3) - 1.0).abs() < 1e-9);
    let mut state = SosState::default();
    assert_eq!([1.0, 2.0, 3.0].map(|x| delay.step(&mut state, x)), [0.0, 1.0, 2.0]);
}
