//! Numbers, names and JSON of an outcome, and statistics.

use hil_sim::outcome::{
    Cell, Figure, Metrics, Origin, Outcome, Panel, SCHEMA_VERSION, Series, Step, Table, joined,
    name,
};
use hil_sim::stats::{Stats, upper_bound_95};
use serde::{Deserialize, Serialize};

#[test]
fn numbers_are_rounded_for_reading_only() {
    assert_eq!(Cell::significant(0.000_123_4, 3).text(), "0.000123");
    assert_eq!(Cell::significant(1.234e-7, 3).text(), "1.23e-7");
    assert_eq!(Cell::significant(123_456.0, 3).text(), "123456");
    assert_eq!(Cell::significant(0.0, 3).text(), "0.00");
    assert_eq!(Cell::fixed(-0.0001, 2).text(), "0.00");
    assert_eq!(Cell::fixed(-1.5, 1).text(), "-1.5");
    assert_eq!(Cell::fixed(f64::NAN, 1).text(), "none");
}

#[test]
fn metrics_are_shown_in_words_and_sensible_digits() {
    for (name, value, text) in [
        ("lost", 1.0, "yes"),
        ("learned_steps_lost", 0.0, "no"),
        ("lost_runs", 1.0, "1"),
        ("runs", 100.0, "100"),
        ("angle_error_rms_deg", 1.63447, "1.634"),
        ("angle_error_rms_deg", f64::NAN, "none"),
    ] {
        assert_eq!(Metrics::cell(name, value).text(), text, "{name}");
    }
}

#[test]
fn a_lost_run_is_lost_in_words() {
    let mut outcome = Outcome::default();
    assert_eq!(outcome.lost(), None);
    outcome.faults.push("fault 4: dc link above its limit".into());
    let session = outcome.lost().unwrap();
    assert_eq!(session, "The drive stopped itself: fault 4: dc link above its limit.");
    outcome.faults.clear();
    outcome.metrics.set("lost", 1.0);
    assert!(outcome.lost().unwrap().starts_with("Lost: the drive stopped"));
    outcome.faults.push("fault 26: the angle is not tracked".into());
    assert_eq!(outcome.lost().unwrap(), "Lost: fault 26: the angle is not tracked.");
    outcome.faults = vec!["run: fault 11".to_owned(); 19];
    assert!(outcome.lost().unwrap().ends_with("run: fault 11; and 9 more."));
}

#[test]
fn json_is_one_object_with_the_agreed_names() {
    let mut outcome = Outcome::default();
    outcome.metrics.set("speed_rpm", 12.5);
    outcome.metrics.set("lost", f64::NAN);
    let step = Step { iq_ref_a: 1.0, iq_a: 0.9, torque_nm: 0.3, angle_error_mean_deg: 5.0 };
    outcome.steps = Some(vec![step]);
    let mut table = Table::new("Levels", &["name", "value"]);
    table.row([Cell::from("a"), Cell::fixed(1.23456, 2)]);
    outcome.tables.push(table);
    let panel = Panel::new("time (s)", "current (A)");
    let panel = panel.with(Series::line("actual", vec![(0.0, 1.0), (1.0, 2.0)]));
    let figure =
        Figure::new("step", "A step", "Figure 38").panel(panel).events([(0.5, "stop".into())]);
    outcome.figures.push(figure);
    outcome.faults.push("fault 4: dc link above its limit".into());
    let changes = ["motor.r_s=6", "load.mode=free", "prepare.learn=true"].map(String::from);
    let text = outcome.to_json("torque-steps", &Origin::new(7, &changes)).unwrap();
    let object: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(object["schema_version"], SCHEMA_VERSION);
    assert_eq!(object["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(object["experiment"], "torque-steps");
    assert_eq!(object["seed"], 7);
    assert_eq!(object["settings"]["motor.r_s"], 6);
    assert_eq!(object["settings"]["load.mode"], "free");
    assert_eq!(object["settings"]["prepare.learn"], true);
    assert_eq!(object["metrics"]["speed_rpm"], 12.5);
    assert!(object["metrics"]["lost"].is_null());
    assert_eq!(object["steps"][0]["torque_nm"], 0.3);
    assert_eq!(object["table"][0]["rows"][0][1], 1.23456);
    assert_eq!(object["series"]["step/current_actual_a"]["y"][1], 2.0);
    assert_eq!(object["events"]["step"][0][1], "stop");
    assert_eq!(object["faults"][0], "fault 4: dc link above its limit");
    assert!(!text.contains('\n'));
}

#[test]
fn absent_parts_are_left_out() {
    let text = Outcome::default().to_json("filters", &Origin::new(1, &[])).unwrap();
    let version = env!("CARGO_PKG_VERSION");
    let expected = format!(
        r#"{{"schema_version":3,"version":"{version}","experiment":"filters","seed":1,"settings":{{}},"metrics":{{}},"series":{{}},"remarks":[],"faults":[]}}"#
    );
    assert_eq!(text, expected);
    let both: serde_json::Value = serde_json::from_str(&joined(&[text.clone(), text])).unwrap();
    assert_eq!(both["experiments"][1]["experiment"], "filters");
}

#[test]
fn names_become_words_with_their_unit() {
    assert_eq!(name::words("angle_error_rms_deg"), "angle error rms (°)");
    assert_eq!(name::words("motor_kc_v_per_a"), "motor kc v per a");
    assert_eq!(name::words("lost_runs"), "lost runs");
}

#[test]
fn names_end_in_their_unit() {
    for (label, expected) in [
        ("quadrature current (A)", "quadrature_current_a"),
        ("angle error (° electrical)", "angle_error_electrical_deg"),
        ("φ̂₂ − θ (° electrical)", "phi_2_theta_electrical_deg"),
        ("saliency (10⁻³)", "saliency_milli"),
        ("Δi (mA)", "delta_i_ma"),
        ("speed (electrical rad/s)", "speed_electrical_rad_s"),
        ("−0.6 dB at (Hz)", "minus_0_6_db_at_hz"),
        ("h (µs)", "h_us"),
        ("leg high (1) or low (0), offset", "leg_high_1_or_low_0_offset"),
        ("outputs on", "outputs_on"),
    ] {
        assert_eq!(name::snake(label), expected);
    }
    assert_eq!(name::of_curve("gain (dB)", "LPF, f32"), "gain_lpf_f32_db");
    assert_eq!(name::of_curve("torque (Nm)", ""), "torque_nm");
}

#[test]
fn equal_names_get_numbers() {
    let mut taken = Vec::new();
    let names = ["a", "b", "a", "a"].map(|text| name::unique(text.to_owned(), &mut taken));
    assert_eq!(names, ["a", "b", "a_2", "a_3"]);
}

#[test]
fn bounds_of_a_rate() {
    // Exact Poisson limits: 2.996, 4.744, 6.296, 16.962.
    for (events, mean) in [(0, 2.9957), (1, 4.7439), (2, 6.2958), (10, 16.962)] {
        assert!((upper_bound_95(events, 1000) * 1e3 - mean).abs() < 1e-3, "{events}");
    }
}

#[test]
fn of_a_few_values() {
    let s = Stats::of([3.0, -4.0, 1.0]);
    assert_eq!(s.mean(), 0.0);
    assert_eq!(s.largest(), 4.0);
    assert!((s.rms() - (26.0_f64 / 3.0).sqrt()).abs() < 1e-12);
    assert!((s.deviation() - s.rms()).abs() < 1e-12);
}

/// A structure with fields like those of [`Stats`].
#[derive(Serialize, Deserialize)]
struct Exact {
    #[serde(with = "hil_sim::stats::exact")]
    sum: f64,
    #[serde(with = "hil_sim::stats::exact")]
    squares: f64,
    #[serde(with = "hil_sim::stats::exact")]
    largest: f64,
}

/// Numbers whose shortest decimal form an inexact parser reads with an error of one bit, and numbers that JSON does not have.
#[test]
fn statistics_are_read_back_to_the_bit() {
    let hard = [0.1 + 0.2, 1.0 / 3.0, 5e-324, 1.797_693_134_862_315_7e308, -0.0, 2.5e-310];
    let mut seed = 1_u64;
    let random = std::iter::repeat_with(|| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from_bits(seed)
    });
    for value in hard.into_iter().chain(random.take(2000)) {
        let stats = Exact { sum: value, squares: f64::NAN, largest: f64::INFINITY };
        let text = serde_json::to_string(&stats).unwrap();
        let back: Exact = serde_json::from_str(&text).unwrap();
        let is_same = back.sum.to_bits() == value.to_bits() || value.is_nan() && back.sum.is_nan();
        assert!(is_same, "{text}");
        assert!(back.squares.is_nan() && back.largest == f64::INFINITY);
    }
}
