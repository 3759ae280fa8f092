//! Tests of the coefficients against independent computations.
#![allow(clippy::disallowed_methods)] // std functions are the reference here
use core::f32::consts::TAU;

use super::*;
use crate::drive::axes::Axes;
use crate::printed::{ComparedLoop, DemodulatorKind};
use crate::settings::Settings;

fn near(value: f32, expected: f32) {
    assert!((value / expected - 1.0).abs() < 1e-4, "{value}, not {expected}");
}

fn built(source: AngleSource) -> Coefficients {
    Settings { angle_source: source, ..Settings::default() }.build().unwrap()
}

#[test]
fn limits_and_times_are_those_of_the_settings_in_periods() {
    let c = built(AngleSource::Encoder);
    // With two pole pairs and 6 kHz, the injection alone tracks up to 700 rpm; with the observer there is no limit.
    let (any, tracked) = (2000.0 / 60.0 * 2.0 / 6000.0, 700.0 / 60.0 * 2.0 / 6000.0);
    near(c.protection.rotor_freq, any);
    near(built(AngleSource::Injection).protection.rotor_freq, any);
    let mut alone = Settings::default();
    alone.observer.enabled = false;
    near(alone.build().unwrap().protection.rotor_freq, tracked);
    near(c.freq_per_speed, 2.0 / 6000.0);
    near(c.protection.i_q, 3.5);
    near(c.current_lag, 0.18);
    let s = &c.sequence;
    assert_eq!((s.precharge, s.magnetise, s.verify), (60, 5583, 1800));
    near(s.stop_ramp, 30.0 / 6000.0);
}

/// A saliency s makes a current difference of sqrt2 I s, and an impedance difference of 2 s V/I.
#[test]
fn impedance_and_current_difference_tell_the_same_saliency() {
    let mut settings = Settings::default();
    settings.injection.demodulator = DemodulatorKind::RmsImpedance;
    let c = settings.build().unwrap();
    let ComparedLoop::Printed(printed) = c.estimator.angle_loop else { panic!("the filter") };
    let (volts, amperes) = (settings.carrier_v(), c.injection.current_amplitude);
    let s = 0.035;
    near(
        printed.ampere_per_ohm * 2.0 * s * volts / amperes,
        core::f32::consts::SQRT_2 * amperes * s,
    );
}

#[test]
fn only_the_sensorless_drive_watches_the_saliency() {
    let (encoder, injection) = (built(AngleSource::Encoder), built(AngleSource::Injection));
    assert!(encoder.saliency_check.is_none() && injection.saliency_check.is_some());
    assert!(encoder.lock_monitor.is_none() && injection.lock_monitor.is_some());
    assert!(encoder.noise_watch.is_none() && injection.noise_watch.is_some());
    assert!(!encoder.inject && injection.inject);
    assert!(!encoder.demodulate && injection.demodulate);
}

/// The voltage acts 1.5 periods after the sample; the measured current is delayed by filter and sensor.
#[test]
fn the_axes_lead_and_lag_by_the_delays() {
    let c = built(AngleSource::Injection);
    let mut axes = Axes::default();
    let step = 50.0 / 6000.0;
    let ahead = UnitVector { cos: 0.0, sin: 1.0 };
    c.turn(&mut axes, step, ahead, false);
    let degrees = |axis: UnitVector| axis.sin.atan2(axis.cos).to_degrees();
    let turned = |samples: f32| samples * step * 360.0;
    assert!((degrees(axes.applied) - turned(1.5)).abs() < 1e-2);
    assert!(
        (degrees(axes.seen) + turned(1.530_4 + 5.315 * (step * TAU).powi(2) + 0.18)).abs() < 1e-2
    );
    assert!((degrees(axes.carrier) - 90.0 + turned(0.18 + 0.053)).abs() < 1e-2);
    assert_eq!(axes.injection, ahead);
}
