//! The numbers of Barroso (2017), recomputed. Printed values that are wrong are asserted as wrong.
//!
//! Elsewhere: plant, rule of section 3.8, controllers, 3.41 and 3.42 and the unstable 4.1 under 4.2 in
//! `drive-core/tests/tuning.rs`; step 3.39 and figure 40 in `drive-core/tests/pi.rs`; filters of appendix C
//! in `drive-core/tests/filters/`; Table 5 in `bench_tests.rs`; appendix A in `identification_arx.rs`.

use std::f64::consts::{PI, TAU};

use drive_core::FirstOrder;
use drive_settings::tuning::{EquivalentCircuit, motor_plant, rule_3_8};
use hil_sim::{Config, Outcome, experiments};

const T: f64 = 1.0 / 6000.0;
const TABLE_5: EquivalentCircuit =
    EquivalentCircuit { r_s: 5.4, r_r: 1.1, l_m: 0.1771, l_ls: 0.0276, l_lr: 0.0276 };

/// Within half a unit of the last digit given.
fn same(name: &str, value: f64, expected: &str) {
    let digits = expected.split('.').nth(1).map_or(0, str::len);
    let expected: f64 = expected.parse().unwrap();
    // A thousandth of a unit more: the expected number is rounded itself.
    let bound = 0.501 * 10f64.powi(-(digits as i32));
    assert!((value - expected).abs() <= bound, "{name} = {value}, not {expected}");
}

fn outcome(name: &str) -> Outcome {
    experiments::run(name, &Config::default(), 1).unwrap()
}

/// Fictitious frequency of the w plane (Eq. 2.18), rad/s, of a pole and of a real one in Hz.
fn of_pole(p: f64) -> f64 {
    2.0 / T * (1.0 - p) / (1.0 + p)
}

fn fictitious(hz: f64) -> f64 {
    2.0 / T * (PI * hz * T).tan()
}

fn real_hz(v: f64) -> f64 {
    (v * T / 2.0).atan() / (PI * T)
}

#[test]
fn d1_plant_of_section_3_6_4() {
    let (l_s, l_r) = (0.2047, 0.2047);
    let sigma = 1.0 - 0.1771f64.powi(2) / (l_s * l_r);
    let k_ft = 1.0 / (5.4 + 1.1 * (0.1771 / l_r).powi(2));
    let t_ft = sigma * l_s * k_ft;
    same("sigma", sigma, "0.25148");
    same("k_FT", k_ft, "0.160685");
    same("T_FT in ms", 1e3 * t_ft, "8.2718");
    same("k_FTD", 1e3 * T * k_ft / t_ft, "3.2376");
    same("p_FTD", 1.0 - T / t_ft, "0.979851");
    // Printed: 0.01973, 8.14 times too small, and from it 1.0157 ms and 0.8359; k_FTD survives.
    same("factor", k_ft / 0.01973, "8.14");
    same("T_FT as it follows from the printed k_FT", 1e3 * sigma * l_s * 0.01973, "1.0157");
    same("p_FTD likewise", 1.0 - T / 1.0157e-3, "0.8359");
    // The exact hold is not Eq. 3.24, which is the forward difference.
    let exact = motor_plant(&TABLE_5, T).unwrap();
    same("k", 1e3 * exact.k, "3.2052");
    same("p", exact.p, "0.980053");
    same("difference to 3.34 in %", 100.0 * (1.0 - 3.237 / 4.0532), "20.14");
}

#[test]
fn d1_poles_are_printed_in_hz_and_are_rad_per_s() {
    // (pole, printed as Hz, rad/s, Hz)
    for (p, rad_s, hz) in [
        (0.8359, "1072.6", "170.7"),
        (0.93916, "376.49", "59.92"),
        (0.9511, "300.75", "47.87"),
        (0.9503, "305.80", "48.67"),
        (0.979851, "122.1", "19.4"),
    ] {
        same("v", of_pole(p), rad_s);
        same("v in Hz", of_pole(p) / TAU, hz);
    }
    // 977.6 Hz is Eq. 2.18 with 1073 taken for Hz; it is 170.3 Hz.
    same("3.33, real", real_hz(of_pole(0.8359)), "170.26");
    same("3.33, as printed", real_hz(TAU * 1073.0), "977.6");
    // 300.88 for 3.42 does not follow from its pole.
    assert!((of_pole(0.9503) - 300.88).abs() > 4.0);
    // The argument of section 3.7, that the plant of the motor alone is faster, collapses.
    assert!(of_pole(0.979851) < of_pole(0.93916));
}

#[test]
fn d1_the_w_plane() {
    // Figure 13.
    let error = |hz: f64| fictitious(hz) / TAU - hz;
    same("600 Hz", error(600.0), "20.55");
    same("600 Hz in %", error(600.0) / 6.0, "3.4");
    same("1 % at 328.8 Hz", 100.0 * error(328.8) / 328.8, "1.00");
    assert!(error(460.0) / 460.0 > 0.0197, "not below 1 % up to 460 Hz");
    // Section 3.8: the crossover, read off a graph as 204.5 Hz.
    let rule = rule_3_8(FirstOrder { k: 0.004_053_2, p: 0.93916 }, T).unwrap();
    same("v", rule.v, "1288.24");
    same("v in Hz", rule.v / TAU, "205.03");
    same("real", real_hz(rule.v), "204.25");
    same("k_c", rule.k_c, "53.000");
    same("z_c", rule.z_c, "0.947726");
    same("34.4 dB", 10f64.powf(34.4 / 20.0), "52.48");
}

#[test]
fn d1_table_6_dead_time_and_skin_depth() {
    // 593 % is the ratio of the gains, an increase by 493 %; the static gain grows less.
    same("ratio", 9.5797 / 1.6145, "5.934");
    let static_gain = |k: f64, re: f64, im: f64| 1e-5 * k / ((1.0 - re) * (1.0 - re) + im * im);
    let (low, high) =
        (static_gain(1.6145, 0.98668, 0.06684), static_gain(9.5797, 0.97686, 0.06461));
    same("static gain at 0.5 A", 1e3 * low, "3.476");
    same("at 3 A", 1e2 * high, "2.034");
    same("ratio", high / low, "5.85");
    // 2.2 us of dead time and of propagation (printed in ms), in shares of the period.
    same("dead time in %", 100.0 * 2.2e-6 / T * 2.0, "2.64");
    same("both in %", 100.0 * 4.4e-6 / T * 2.0, "5.28");
    // Eq. 3.16 with the conductivity of copper, 5.8e7 S/m.
    let depth = 1e3 / (PI * 60.0 * 4e-7 * PI * 5.8e7_f64).sqrt();
    same("skin depth in mm", 1e3 * 0.066 / 60f64.sqrt(), "8.52");
    assert!((depth - 8.53).abs() < 0.01, "{depth}");
}

#[test]
fn d1_calibration_lines() {
    let lines = outcome("adc-calibration");
    let metric = |name: &str| lines.metrics.get(name).unwrap();
    // Eq. 3.5: all digits.
    same("slope A", 1e6 * metric("slope_a_a"), "2212.02");
    same("intercept A", metric("intercept_a_a"), "-4.47271336");
    same("slope B", 1e6 * metric("slope_b_a"), "2231.42");
    same("intercept B", metric("intercept_b_a"), "-4.49662384");
    same("largest residual A in mA", 1e3 * metric("largest_residual_a_a"), "8.7");
    same("largest residual B in mA", 1e3 * metric("largest_residual_b_a"), "10.2");
    // The largest code is 4095, not 4096.
    same("end of the range A", metric("full_scale_a_a"), "4.5855");
    same("end of the range B", metric("full_scale_b_a"), "4.6410");
}

#[test]
fn d1_figure_40() {
    let figure = outcome("anti-windup");
    let metric = |name: &str| figure.metrics.get(name).unwrap();
    same("y without", metric("plain_y_max"), "2.005");
    same("u without", metric("plain_u_max"), "0.869");
    same("u at the crossing", metric("plain_u_at_crossing"), "0.854");
    same("saturated", metric("plain_saturated_ratio"), "0.76");
    same("y with", metric("anti_windup_y_max"), "1.301");
    same("saturated with", metric("anti_windup_saturated_ratio"), "0.035");
    // The delayed index of B.1 is unstable even without a limit.
    same("pole of B.1 as printed", metric("printed_index_largest_pole"), "1.0996");
}
