//! Tests of the limits against the power of the model, over speeds, limits and errors of the model.

use core::f32::consts::TAU;
use std::sync::LazyLock;

use super::*;
use crate::settings::Settings;
use crate::{Dq, Motor};

const BUILT: crate::blocks::Power = crate::blocks::Power::IN_BUILD.unwrap();

const DC_LINK: f32 = 300.0;
const MAGNETISING: f32 = 1.4;
const ASKED: f32 = 50.0;
/// Coefficients of the default motor. Their computation takes longer than a test of the limits.
static COEFFICIENTS: LazyLock<Coefficients> =
    LazyLock::new(|| Settings::default().build().unwrap());

/// Returns the least and largest q-axis current at this speed, Hz electrical, if the model does not explain `error` W.
fn limits(hz: f32, motoring: DcLimit, generating: DcLimit, error: f32) -> (f32, f32) {
    let (c, limit) = (&*COEFFICIENTS, PowerLimit { built: BUILT, motoring, generating });
    let mut seen =
        Telemetry { dc_link: DC_LINK, rotor_freq: hz * PERIOD_S, ..Telemetry::default() };
    seen.current = Dq { d: MAGNETISING, q: 0.0 };
    seen.voltage.d = (c.voltage_limit.r_s * MAGNETISING * MAGNETISING + error) / MAGNETISING;
    let (mut state, mut found) =
        (error, DcLinkLimits { i_q: (-ASKED, ASKED), ..Default::default() });
    limit.step(c, &mut state, &mut found, &seen, (MAGNETISING, 0.0));
    assert!((state - error).abs() < 1e-3, "{state}");
    for (bound, why) in [(found.i_q.0, found.why.0), (found.i_q.1, found.why.1)] {
        assert_eq!(why == Limiting::Power, bound.abs() < ASKED, "{bound}");
    }
    found.i_q
}

fn watts(power_w: f32) -> DcLimit {
    DcLimit { current_a: 1000.0, power_w }
}

/// Returns the power at a q-axis current, W.
fn power(hz: f32, i_q: f32, error: f32) -> f32 {
    let m = Motor::DEFAULT;
    let rotor = m.r_r * (m.l_m / m.l_r()) * (m.l_m / m.l_r());
    let emf = TAU * hz * m.coupled_inductance() * MAGNETISING;
    1.5 * (m.r_s * (MAGNETISING * MAGNETISING + i_q * i_q) + rotor * i_q * i_q + emf * i_q + error)
}

/// Every q-axis current between the limits keeps both power limits. A current beyond does not, except where the copper
/// losses absorb the power of a larger generating current. No torque is reversed.
#[test]
fn what_is_allowed_keeps_the_limits_and_no_torque_is_reversed() {
    for hz in (-600..=600).map(|n| n as f32 * 0.25) {
        for error in [0.0, -3.0, 20.0] {
            let losses = power(hz, 0.0, error);
            let lowest = (-1000..1000).map(|n| power(hz, n as f32 * 0.02, error));
            let lowest = lowest.fold(f32::MAX, f32::min);
            for (most, least) in [25.0, 60.0, 300.0]
                .into_iter()
                .flat_map(|most| [0.0, 60.0, 300.0].map(|least| (most, least)))
            {
                let (low, high) = limits(hz, watts(most), watts(least), error);
                let case = || format!("{hz} Hz, {most} W, {least} W, {error}: {low} to {high}");
                assert!(low <= 0.0 && high >= 0.0, "{}", case());
                let (over, under) = (f32::max(most, losses), f32::min(-least, losses));
                for n in 0..=20 {
                    let p = power(hz, low + (high - low) * n as f32 / 20.0, error);
                    assert!(p < over + 0.1 && p > under - 0.1, "{}: {p} W", case());
                }
                for beyond in [low - 0.02, high + 0.02] {
                    let p = power(hz, beyond, error);
                    let all = lowest > -least - 0.1;
                    assert!(p > most || p < -least || all, "{}: {p} W at {beyond} A", case());
                }
            }
        }
    }
}

/// A dc current limit counts as a power at the present voltage, and the smaller of both limits is valid.
#[test]
fn current_and_power_hold_together() {
    let both = |current_a, power_w| limits(50.0, DcLimit { current_a, power_w }, watts(1e6), 0.0).1;
    assert_eq!(both(0.5, 1e6), both(1000.0, 0.5 * DC_LINK));
    assert_eq!(both(0.5, 100.0), both(1000.0, 100.0));
    let both = |current_a, power_w| limits(50.0, watts(1e6), DcLimit { current_a, power_w }, 0.0).0;
    assert_eq!(both(0.2, 1e6), both(1000.0, 0.2 * DC_LINK));
    assert_eq!(both(0.2, 30.0), both(1000.0, 30.0));
}

/// A limit has no step over the speed: 0.25 Hz change it by a quarter or 0.6 A at most.
#[test]
fn the_torque_comes_and_goes_smoothly() {
    for (most, least) in [(60.0, 0.0), (60.0, 20.0), (300.0, 100.0)] {
        let mut before = limits(-150.0, watts(most), watts(least), 0.0);
        for hz in (-599..=600).map(|n| n as f32 * 0.25) {
            let now = limits(hz, watts(most), watts(least), 0.0);
            for (a, b) in [(before.0, now.0), (before.1, now.1)] {
                let change = (a - b).abs();
                assert!(change < f32::max(0.6, 0.25 * a.abs()), "{hz} Hz: {a} to {b} A");
            }
            before = now;
        }
    }
}

/// Kinetic buffering has priority.
#[test]
fn ride_through_comes_first() {
    let c = Settings::default().build().unwrap();
    let limit = PowerLimit { built: BUILT, motoring: watts(100.0), generating: watts(0.0) };
    let mut seen =
        Telemetry { dc_link: DC_LINK, rotor_freq: 50.0 * PERIOD_S, ..Telemetry::default() };
    seen.current.d = MAGNETISING;
    let mut found = DcLinkLimits { i_q: (-3.0, -2.0), ..DcLinkLimits::default() };
    limit.step(&c, &mut 0.0, &mut found, &seen, (MAGNETISING, 0.0));
    assert_eq!(found.i_q, (-2.0, -2.0));
}
