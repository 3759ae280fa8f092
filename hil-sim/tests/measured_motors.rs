//! The simulated motor against a load test that others have measured, and against a published curve.

use hil_sim::experiments::measured_motors::{measured, no_load, published, simulated, started};

#[test]
fn the_18_kw_motor_at_its_14_measured_points() {
    let measured = measured().expect("table");
    assert_eq!(measured.len(), 14);
    for (m, s) in measured.iter().zip(simulated(&measured).expect("a motor")) {
        let current = s.current_a / m.current_a - 1.0;
        let (slip, measured_slip) = (1500.0 - s.speed_rpm, 1500.0 - m.speed_rpm);
        let efficiency = s.efficiency - m.efficiency;
        assert!((s.power_w - m.power_w).abs() < 1.0, "{s:?}");
        assert!(current.abs() < 0.03, "{s:?}");
        let slip_error = (slip - measured_slip).abs();
        assert!(slip_error < 0.5 || slip_error < 0.05 * measured_slip, "{s:?}");
        assert!(m.power_w < 3500.0 || efficiency.abs() < 0.005, "{s:?} {m:?}");
        // This value was not fitted, so it is a check: within 0.016 everywhere.
        assert!((s.power_factor - m.power_factor).abs() < 0.016, "{s:?}");
    }
}

#[test]
fn the_2_kw_motor_follows_its_published_curve() {
    for voltage in [100.0, 200.0, 300.0, 350.0, 400.0, 430.0] {
        let (psi, current) = no_load(voltage).expect("a motor");
        let published = published(psi);
        // The circuit has 10 uH of stator leakage: 3e-5 of the inductance, times 8 in the derivative.
        assert!(
            (current / published - 1.0).abs() < 3e-4,
            "{voltage} V: {current} for {published} A"
        );
    }
    // At 400 V the motor is saturated by a third.
    let (psi, current) = no_load(400.0).expect("a motor");
    assert!(psi > 0.9 && current / (psi / 0.34) > 1.2, "{psi} Wb, {current} A");
}

/// The supply of the record is softer than 400 V, so only the ratio of the peaks is compared. The locked-rotor current,
/// to which both were fitted, equals that of the record.
#[test]
fn leakage_that_saturates_makes_the_measured_start() {
    let [energy, linear] = [false, true].map(|linear| started(linear).expect("a motor"));
    assert!((energy[0] / linear[0] - 89.0 / 64.0).abs() < 0.1, "{energy:?} {linear:?}");
    // 51 rpm and 67 rpm; in proportion to the square of the voltage.
    assert!((energy[1] / linear[1] - 51.1 / 67.0).abs() < 0.01, "{energy:?} {linear:?}");
    for locked in [energy[3], linear[3]] {
        assert!((locked / 12.9 - 1.0).abs() < 0.01, "{locked} A");
    }
    assert!((energy[2] / 7.58 - 1.0).abs() < 0.02 && (linear[2] / 7.58 - 1.0).abs() < 0.01);
}
