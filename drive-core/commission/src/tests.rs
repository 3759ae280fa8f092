//! Tests of the fits on a motor whose response is computed here, in f64.
#![allow(clippy::disallowed_methods)] // std functions are the reference here

use super::collector::{Collector, Record};
use super::fit::{Fitted, Search, bent};
use drive_core::{AlphaBeta, PERIOD_S};

const T: f64 = PERIOD_S as f64;

/// A motor at rest, one axis.
#[derive(Clone, Copy)]
struct Motor {
    r_s: f64,
    leakage: f64,
    r_r: f64,
    tau_r: f64,
    /// Voltage error of the inverter, V.
    e: f64,
}

/// Returns the sums of a current that approaches 2.9 A, then 0.72 A, within about 10 ms each.
fn levels(motor: &Motor) -> Collector {
    let mut sums = Collector::default();
    let (mut i, mut i_m, mut last) = (0.0, 0.0, None);
    for (half, level) in [2.9, 0.72].into_iter().enumerate() {
        sums.begin(Record::bins(half, 1.5));
        for _ in 0..9000 {
            let measured = i;
            // The period is computed in parts: the current moves on a straight line, and the flux follows it.
            let next = i + (level - i) * T / 0.01;
            let (parts, mut volts) = (20, 0.0);
            for part in 0..parts {
                let now = i + (next - i) * (f64::from(part) + 0.5) / f64::from(parts);
                volts += motor.r_r * (now - i_m) / f64::from(parts);
                i_m += (now - i_m) * T / f64::from(parts) / motor.tau_r;
            }
            volts += motor.r_s * 0.5 * (i + next) + motor.e + motor.leakage * (next - i) / T;
            i = next;
            // The voltage that acts from this sample to the next was realised in the step before.
            if let Some((measured, _)) = last {
                sums.push(measured, AlphaBeta::new(volts as f32, 0.0), 311.0);
            }
            last = Some((AlphaBeta::new(measured as f32, 0.0), volts));
        }
    }
    sums
}

fn found(sums: &Collector) -> Fitted {
    let mut search = Search::new(0.0, false);
    loop {
        if let Some(fit) = search.step(sums).unwrap() {
            return fit;
        }
    }
}

#[test]
fn the_levels_give_back_the_motor() {
    // The cases are Table 5, a slow rotor, and a fast rotor with much leakage.
    for (r_s, leakage, r_r, tau_r, e) in [
        (5.4, 0.0515, 0.823, 0.186, 7.0),
        (2.7, 0.028, 0.45, 0.7, 12.0),
        (10.8, 0.1, 1.6, 0.05, 4.0),
    ] {
        let fit = found(&levels(&Motor { r_s, leakage, r_r, tau_r, e }));
        let near = |found: f32, truth: f64, within: f64, name: &str| {
            let error = f64::from(found) / truth - 1.0;
            assert!(error.abs() < within, "{name}: {found}, not {truth}: {error}");
        };
        near(fit.r_s, r_s, 5e-4, "r_s");
        near(fit.e, e, 1e-3, "e");
        near(fit.r_r, r_r, 5e-3, "R_R");
        near(fit.tau_r, tau_r, 5e-3, "tau_r");
    }
}

#[test]
fn steady_voltages_give_resistance_and_bend() {
    // 140 pF at 311 V and 6 kHz.
    let (r_s, e, d) = (5.4, 7.0, 0.054);
    let point = |i: f32| (i, r_s * i + e - d / i);
    let found = bent(&[2.9, 0.72, 1.6].map(point)).unwrap();
    for (found, truth) in found.into_iter().zip([r_s, e, d]) {
        assert!((found / truth - 1.0).abs() < 1e-3, "{found}, not {truth}");
    }
    assert!(bent(&[2.9, 0.72].map(point)).is_err(), "two levels do not tell a bend");
}
