//! The endurance test: torque at zero stator frequency and a slow reversal, against the equations of the motor.

use hil_sim::outcome::Metrics;
use hil_sim::{Config, experiments};

fn record(set: &[&str]) -> Metrics {
    let short = ["record.minutes=0.1", "record.reversal_s=5"];
    let config = Config::load(None, None, &[&short, set].concat()).expect("allowed settings");
    experiments::run("record", &config, 3).expect("a record").metrics
}

/// The slip at i_d = 0.7 A is i_q/0.7 r_r/L_r, 36.66 rpm per ampere on four poles. The shaft turns at this speed
/// against the slip while the flux is fixed. Healthy angles change the slip little: 60 runs of the saliency
/// self-commissioning (seeds 101 to 160) by 1.7 rpm in the mean and 4.4 at most with the flux at 0 degrees, and by 2.2
/// and 7.2 at 100 degrees. The learned saliency sensitivity allows 2.25 A to 3 A of q-axis current.
#[test]
fn full_torque_is_held_at_zero_stator_frequency() {
    for at in ["record.flux_deg=0", "record.flux_deg=100"] {
        let metrics = record(&[at]);
        let get = |name: &str| metrics.get(name).expect(name);
        let limit = get("limit_a");
        let slip = 36.66 * limit;
        assert!((get("hold_speed_rpm") - slip).abs() < 8.0, "{}", get("hold_speed_rpm"));
        // In 6 s the flux does not move further than its travel: a revolution would be 0.17 Hz.
        assert!(get("hold_stator_hz") < 0.05, "{}", get("hold_stator_hz"));
        // The noise of the estimated angle moves the flux; a rotating flux would pass 180 degrees.
        assert!(get("hold_flux_travel_deg") < 90.0, "{}", get("hold_flux_travel_deg"));
        assert!((2.25..=3.0).contains(&limit), "{limit}");
        assert!((get("limit_nm") / limit - 0.9653 / 3.0).abs() < 1e-3);
        for key in ["hold", "reversal"] {
            assert_eq!(get(&format!("{key}_lost")), 0.0);
            assert!(get(&format!("{key}_error_mean_deg")) < 1.5, "{key}: {metrics:?}");
            assert!(get(&format!("{key}_error_max_deg")) < 13.0, "{key}: {metrics:?}");
        }
    }
}

/// If the flux is fixed, a warm rotor and stator look like sensor gains that drift. The estimator of that drift must
/// not mistake them for one: from the first to the last minute of eight the angle moves by 0.14°. It moved by 1.19°
/// when noise of the frequency was mistaken for a rotating flux.
#[test]
#[ignore = "cargo xtask prove long-tests"]
fn the_angle_does_not_creep_at_zero_stator_frequency() {
    let metrics = record(&[
        "plant=r",
        "flux_level=high",
        "sequence.flux=high",
        "record.minutes=8",
        "record.reversal_s=1",
        "record.flux_deg=75",
        "after.motor.r_r=1.43",
        "after.motor.r_s=6.48",
    ]);
    let drift = metrics.get("hold_drift_deg").expect("a drift");
    assert_eq!(metrics.get("hold_lost"), Some(0.0));
    assert!(drift < 0.5, "{drift}");
}

/// A slow reversal at the torque limit: from 150 rpm on, `i_q` and `g w_r i_d` nearly cancel. The voltage then shows
/// almost nothing of the stator resistance for half a minute, while saturation makes the slip wrong. When the
/// resistance did not return to the measured value, it went to its limit, 40 % off, and fault 41 stopped all three
/// runs.
#[test]
#[ignore = "cargo xtask prove long-tests"]
fn a_slow_reversal_at_the_torque_limit_is_borne() {
    for plant in ["plant=r", "plant=g7", "plant=m4b"] {
        // At the magnetising current and the current limit of the measurement. With 2.31 A of both, which the sensors'
        // range allows by rule, the error of m4b is 2.55 degrees in the mean.
        let high = [
            "flux_level=high",
            "sequence.flux=high",
            "sequence.i_d=1.991",
            "limits.current_a=3.5",
            "record.reversal_s=60",
        ];
        let metrics = record(&[&[plant], high.as_slice()].concat());
        assert_eq!(metrics.get("reversal_lost"), Some(0.0), "{plant}");
        assert!(metrics.get("reversal_error_mean_deg").is_some_and(|mean| mean < 2.0), "{plant}");
    }
}

/// With an encoder and an assumed rotor resistance twice too large the drive imposes twice the slip, 251 rpm with the
/// 3.43 A that 3.5 A leave beside 0.7 A. The flux then lies at atan(i_q/i_d) - atan(2 i_q/i_d) = -5.72 degrees from the
/// angle that the drive assumes, in either test.
#[test]
fn a_wrong_slip_shows_as_speed_and_angle() {
    let metrics = record(&["angle_source=encoder", "drive.motor.r_r=2.2"]);
    let get = |name: &str| metrics.get(name).expect(name);
    assert!((get("hold_speed_rpm") - 251.4).abs() < 2.0, "{}", get("hold_speed_rpm"));
    for name in ["hold_error_mean_deg", "reversal_error_mean_deg"] {
        assert!((get(name) - 5.72).abs() < 0.4, "{name}: {}", get(name));
    }
    assert!(get("hold_drift_deg") < 0.2, "{}", get("hold_drift_deg"));
}
