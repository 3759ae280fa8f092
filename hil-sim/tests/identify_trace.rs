//! Identification of the motor from records of the plant: of a motor on the mains, measured at its terminals, and of one at an inverter.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli_common::{folder, hil_sim, object, text};
use crate::duties::{TOP, duties};
use hil_sim::config::{Config, plant_settings};
use hil_sim::experiments::identify_trace::{Reading, Voltages, identify};
use hil_sim::outcome::Outcome;
use hil_sim::plant::{
    Complex, ElectricalState as _, EnergyMachine, InverterSettings, IronSettings, Load,
    MachineSettings, MeasurementSettings, Mechanics, MechanicsSettings, MotorModel, Plant,
    PlantSettings, clarke, phases,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// A motor of about 4 kW.
const MOTOR: MachineSettings = MachineSettings {
    rs: 1.267,
    rr: 1.287,
    lls: 0.00824,
    llr: 0.00824,
    lm: 0.1289,
    ..MachineSettings::DEFAULT
};
/// A motor with an L_s of 169.4 mH, and its four parameters.
const MILL: MachineSettings = MachineSettings {
    rs: 2.448,
    rr: 1.5456,
    lls: 0.0075,
    llr: 0.0075,
    lm: 0.1619,
    ..MachineSettings::DEFAULT
};
const MILL_PARAMETERS: [(&str, f64); 4] =
    [("r_s_ohm", 2.448), ("tau_r_s", 0.1096), ("sigma_l_s_mh", 14.67), ("l_s_mh", 169.4)];
/// The transient inductance of the first motor, H.
const SIGMA_L_S: f64 = 0.01598;
const RATES: [f64; 4] = [2000.0, 5000.0, 10_000.0, 20_000.0];

/// A row: time, voltage, current, speed in rpm.
type Row = (f64, Complex, Complex, f64);

/// Noise with a normal distribution except for its tails.
fn noise(random: &mut impl Rng, size: f64) -> Complex {
    let mut one = || size * ((0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0);
    Complex::new(one(), one())
}

/// Simulates a motor on 400 V, 50 Hz, sampled: 0.3 s after the run-up, and 0.5 s after a load step at 0.3 s. The
/// current has 30 mA of noise.
fn on_the_mains(iron: &IronSettings, rate: f64, load: [Load; 2], seed: u64) -> Vec<Row> {
    let machine = EnergyMachine::new(&MOTOR, iron).expect("a machine");
    let shaft = MechanicsSettings { inertia: 0.05, load: load[0], ..Default::default() };
    let mut motor = MotorModel::new(machine, Mechanics::new(&shaft).expect("a shaft"));
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let v = |t: f64| Complex::from_polar(326.6, TAU * 50.0 * t);
    let (steps, begin) = ((40_000.0 / rate) as u32, 0.5);
    let mut rows = Vec::new();
    for k in 0..((begin + 0.8) * rate) as u32 {
        let t = f64::from(k) / rate;
        if t >= begin {
            let i = motor.state.electrical.current();
            let rpm = motor.state.speed * 60.0 / TAU;
            rows.push((t - begin, v(t), i + noise(&mut random, 0.03), rpm));
        }
        if t >= begin + 0.3 {
            motor.mechanics.set_load(load[1]).expect("a load");
        }
        let h = 1.0 / rate / f64::from(steps);
        for n in 0..steps {
            motor.step(v(t + (f64::from(n) + 0.5) * h), h);
        }
    }
    rows
}

/// Simulates a motor at an inverter with a voltage error of 4 V, at steps of frequency, flux and load; the recorded
/// voltage is the commanded one.
fn behind_an_inverter(rate: f64, seed: u64) -> Vec<Row> {
    let inverter = InverterSettings { vdc: 560.0, residual_v: 4.0, ..InverterSettings::IDEAL };
    let mut settings =
        PlantSettings { machine: MOTOR, inverter, substeps: 20, ..Default::default() };
    settings.iron = Some(IronSettings::LINEAR);
    settings.measurement = MeasurementSettings::IDEAL;
    settings.mechanics.load = Load::Speed { speed: 25.0 };
    let mut plant = Plant::new(&settings, seed).expect("a plant");
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let (mut rows, mut angle) = (Vec::new(), 0.0);
    for k in 0..(1.2 * rate) as u32 {
        let t = f64::from(k) / rate;
        // Slip and flux.
        let (slip, flux) =
            [(3.0, 0.8), (8.0, 1.0), (-6.0, 0.7), (5.0, 0.9)][(t / 0.3).min(3.0) as usize];
        let w = 2.0 * plant.mechanical_speed() + slip;
        let u = Complex::from_polar((w * flux).abs() + 8.0, angle);
        let compare = duties(phases(u).map(|u| 0.5 + u / 560.0));
        let legs = [compare.a, compare.b, compare.c].map(|c| 560.0 * f64::from(c) / f64::from(TOP));
        let i = plant.current() + noise(&mut random, 0.02);
        rows.push((t, clarke(legs), i, plant.mechanical_speed() * 60.0 / TAU));
        plant.advance(&compare, 1.0 / rate);
        angle += w / rate;
    }
    rows
}

fn written(folder: &Path, name: &str, rows: &[Row]) -> PathBuf {
    let mut text = "time_s,u_alpha_v,u_beta_v,i_alpha_a,i_beta_a,speed_rpm\n".to_owned();
    for (t, v, i, rpm) in rows {
        let ([u, w], [a, b]) = ([v.re, v.im], [i.re, i.im]);
        writeln!(text, "{t:.6},{u:.4},{w:.4},{a:.5},{b:.5},{rpm:.3}").unwrap();
    }
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// Distance of the channels of [`scanned`], s.
const SKEW_S: f64 = 11.55e-6;

/// Records a motor of a mill on 208 V, 60 Hz with cuts, at 8 kHz: six channels are sampled one after another. The
/// voltages are those of the phases, or from line to line.
fn scanned(folder: &Path, lines: bool) -> PathBuf {
    let machine = EnergyMachine::new(&MILL, &IronSettings::LINEAR).expect("a machine");
    let shaft = MechanicsSettings { inertia: 0.02, ..Default::default() };
    let mut motor = MotorModel::new(machine, Mechanics::new(&shaft).expect("a shaft"));
    let mut random = Xoshiro256PlusPlus::seed_from_u64(9);
    let v = |t: f64| {
        let of = |volt, turns: f64| Complex::from_polar(volt, TAU * 60.0 * turns * t);
        of(169.8, 1.0) + of(3.0, -5.0)
    };
    let mut text = "time_s,u_a_v,u_b_v,u_c_v,i_a_a,i_b_a,i_c_a,speed_rpm\n".to_owned();
    if lines {
        text = text.replace("u_a_v,u_b_v,u_c_v", "u_ab_v,u_bc_v,u_ca_v");
    }
    for row in 0..16_000 {
        let t = f64::from(row) / 8000.0;
        let cut = if row > 8000 && (row / 2000) % 2 == 0 { 6.0 } else { 0.5 };
        motor.mechanics.set_load(Load::Free { torque: cut }).expect("a load");
        let (mut cells, speed) = (Vec::new(), motor.state.speed * 60.0 / TAU);
        for channel in 0..6 {
            let at = t + f64::from(channel) * SKEW_S;
            let (n, u) = (channel as usize % 3, phases(v(at)));
            cells.push(match channel {
                0..3 if lines => u[n] - u[(n + 1) % 3],
                0..3 => u[n],
                _ => phases(motor.state.electrical.current())[n] + noise(&mut random, 0.02).re,
            });
            let step = if channel < 5 { SKEW_S } else { 125e-6 - 5.0 * SKEW_S };
            (0..3).for_each(|k| motor.step(v(at + (f64::from(k) + 0.5) * step / 3.0), step / 3.0));
        }
        let cells = cells.iter().map(|cell| format!("{cell:.4}")).collect::<Vec<_>>().join(",");
        writeln!(text, "{t:.6},{cells},{speed:.3}").unwrap();
    }
    let path = folder.join(format!("mill-{lines}.csv"));
    std::fs::write(&path, text).unwrap();
    path
}

fn reading(voltages: Voltages) -> Reading {
    Reading::of(voltages)
}

fn identified(path: &Path, reading: &Reading) -> Result<Outcome, String> {
    let config = Config::of_motor(Some("buildings-4kw")).expect("a motor");
    let outcome = identify(path, reading, &config).map_err(|error| error.to_string());
    match &outcome {
        Ok(outcome) => println!(
            "{}\n{}\n{:?}",
            path.display(),
            hil_sim::report::text(outcome),
            outcome.metrics
        ),
        Err(error) => println!("{}: {error}", path.display()),
    }
    outcome
}

fn steps() -> [Load; 2] {
    [0.0, 29.0].map(|torque| Load::Free { torque })
}

#[test]
fn resistance_leakage_and_drop_are_found_at_each_rate_and_supply() {
    let folder = folder("identify-rates");
    for (n, rate) in RATES.into_iter().enumerate() {
        let mains = on_the_mains(&IronSettings::LINEAR, rate, steps(), n as u64);
        let held = behind_an_inverter(rate, n as u64);
        let commanded = Reading { delay: Some(0.0), ..reading(Voltages::Commanded) };
        for (name, rows, reading, drop) in
            [("mains", mains, reading(Voltages::Sampled), 0.0), ("inverter", held, commanded, 4.0)]
        {
            let path = written(&folder, &format!("{name}-{rate}.csv"), &rows);
            let metrics = identified(&path, &reading).expect("a motor").metrics;
            let of = |name: &str| metrics.get(name).expect(name);
            assert!((of("r_s_ohm") / MOTOR.rs - 1.0).abs() < 0.02, "{}", of("r_s_ohm"));
            assert!((of("sigma_l_s_mh") / (1e3 * SIGMA_L_S) - 1.0).abs() < 0.02);
            assert!((of("drop_v") - drop).abs() < 0.5, "{}", of("drop_v"));
        }
    }
}

#[test]
fn a_record_that_does_not_tell_the_motor_is_refused_by_name() {
    let folder = folder("identify-refused");
    let mains = |load| on_the_mains(&IronSettings::LINEAR, 5000.0, load, 7);
    let of_speed = |factor: f64| {
        let rows = mains(steps()).into_iter();
        rows.map(|(t, v, i, rpm)| (t, v, i, factor * rpm)).collect::<Vec<Row>>()
    };
    let mut outliers = of_speed(1.0);
    outliers[200].3 = 41_967.0;
    outliers[900].3 = 195.0;
    let mut lines = of_speed(1.0);
    lines.iter_mut().for_each(|row| row.1 *= Complex::new(1.5, 0.75_f64.sqrt()));
    for (name, rows, why) in [
        ("locked.csv", mains([Load::Locked; 2]), "the shaft does not turn"),
        ("radians.csv", of_speed(TAU / 60.0), "the speed seems to be in rad/s"),
        ("turns.csv", of_speed(1.0 / 60.0), "the speed seems to be in turns per second"),
        (
            "sense.csv",
            of_speed(-1.0),
            "with 2 pole pairs is -48.5 Hz; the speed seems to be of opposite sign",
        ),
        ("electrical.csv", of_speed(2.0), "electrical, or the motor has 1 pole pair"),
        ("pairs.csv", of_speed(2.0 / 3.0), "that of a motor with 3 pole pairs"),
        ("outliers.csv", outliers, "line 202: speed_rpm = 41967 is an outlier"),
        ("lines.csv", lines, "look like those from line to line: call them u_ab_v"),
        (
            "idle.csv",
            mains([steps()[0]; 2]),
            "no load: the slip is too small to determine the rotor time constant",
        ),
    ] {
        let path = written(&folder, name, &rows);
        let error = identified(&path, &reading(Voltages::Sampled)).expect_err(name);
        assert!(error.contains(name) && error.contains(why), "{error}");
    }
}

/// With the skew of the channels the motor is found; without it, the deviations contain its effect.
#[test]
fn channels_may_be_sampled_one_after_another_and_from_line_to_line() {
    let folder = folder("identify-skew");
    let sampled = reading(Voltages::Sampled);
    let of = |path: &Path, skew_s: Option<f64>| {
        let times = [Some(0.8), None];
        let reading = Reading { skew_s, times, ..sampled.clone() };
        identified(path, &reading)
    };
    let [phases, lines] = [false, true].map(|lines| scanned(&folder, lines));
    let [known, unknown, at_once, from_lines] =
        [(&phases, Some(SKEW_S)), (&phases, None), (&phases, Some(0.0)), (&lines, Some(SKEW_S))]
            .map(|(path, skew_s)| of(path, skew_s).expect("a motor"));
    assert!(unknown.remarks[0].contains("sampled one after another, 20.8 µs apart"));
    let mut outside = 0;
    for (name, truth) in MILL_PARAMETERS {
        let value = |outcome: &Outcome, name: &str| outcome.metrics.get(name).expect(name);
        let found = value(&known, name);
        assert!((found / truth - 1.0).abs() < 0.03, "{name}: {found}, true {truth}");
        assert!((value(&from_lines, name) / found - 1.0).abs() < 0.005, "{name}");
        let (stem, unit) = name.rsplit_once('_').expect("a unit");
        let deviation = format!("{stem}_deviation_{unit}");
        let off = (value(&unknown, name) - truth).abs();
        assert!(off < value(&unknown, &deviation), "{name}: off by {off}");
        outside += u32::from(off > 3.0 * value(&at_once, &deviation));
    }
    // Channels that are said to be sampled at once: the error exceeds the statistical deviation by far.
    assert!(outside > 1, "{outside}");
    for (reading, why) in [
        (Reading { skew_s: Some(26e-6), ..sampled.clone() }, "--skew 26.00: with 6 channels"),
        (Reading { skew_s: Some(1e-6), ..reading(Voltages::Mean) }, "needs --voltages sampled"),
    ] {
        let error = identified(&phases, &reading).expect_err(why);
        assert!(error.contains(why), "{error}");
    }
}

/// The same motor from phase values; their common-mode part is ignored, and a remark says so.
#[test]
fn rows_are_chosen_and_phases_need_not_sum_to_zero() {
    let folder = folder("identify-phases");
    let rows = on_the_mains(&IronSettings::LINEAR, 5000.0, steps(), 5);
    let mut text = "time_s,u_a_v,u_b_v,u_c_v,i_a_a,i_b_a,speed_rpm\n".to_owned();
    for (t, v, i, rpm) in &rows {
        let common = 7.0 * (TAU * 50.0 * t).cos();
        let ([a, b, c], [i_a, i_b, _]) = (phases(*v).map(|v| v + common), phases(*i));
        writeln!(text, "{t:.4},{a:.4},{b:.4},{c:.4},{i_a:.4},{i_b:.4},{rpm:.3}").unwrap();
    }
    let path = folder.join("phases.csv");
    std::fs::write(&path, &text).unwrap();
    let sampled = reading(Voltages::Sampled);
    let from = |from| Reading { times: [Some(from), Some(0.7)], ..sampled.clone() };
    let by_time = identified(&path, &from(0.1)).expect("a motor");
    assert!((by_time.metrics.get("r_s_ohm").unwrap() / MOTOR.rs - 1.0).abs() < 0.02);
    let remarks = by_time.remarks.join("\n");
    assert!(remarks.contains("u_c_v and the others have 2.1 % of u_a_v in common"), "{remarks}");
    assert!(remarks.contains("No i_c_a: taken as −a −b"), "{remarks}");
    let error = identified(&path, &from(0.69)).unwrap_err();
    assert!(error.contains("51 rows; at least 100 are needed"), "{error}");
    for (from, to, why) in [
        (",", ";", "the separator must be a comma"),
        (",", "\t", "the separator must be a comma"),
        (
            "time_s,u_a_v,u_b_v,u_c_v,i_a_a,i_b_a,speed_rpm\n",
            "",
            "the first line must name the columns",
        ),
    ] {
        let other = folder.join("other.csv");
        std::fs::write(&other, text.replace(from, to)).unwrap();
        let error = identified(&other, &sampled).expect_err(why);
        assert!(error.contains(why) && error.len() < 250, "{error}");
    }
    let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    std::fs::write(&path, [&[0xff, 0xfe], &wide[..]].concat()).unwrap();
    let error = identified(&path, &sampled).unwrap_err();
    assert!(error.contains("UTF-16 text; save the file as CSV in UTF-8"), "{error}");
}

/// A record whose voltage was reduced by more than the inverter voltage error.
#[test]
fn a_drop_is_not_negative() {
    let folder = folder("identify-drop");
    let mut rows = behind_an_inverter(10_000.0, 1);
    for (_, v, i, _) in &mut rows {
        *v -= clarke(phases(*i).map(|i| 6.0 * i.signum()));
    }
    let path = written(&folder, "less.csv", &rows);
    let reading = Reading { delay: Some(0.0), ..reading(Voltages::Commanded) };
    let outcome = identified(&path, &reading).expect("a motor");
    assert_eq!(outcome.metrics.get("drop_v"), Some(0.0));
    assert!(outcome.remarks[0].contains("would be negative"), "{:?}", outcome.remarks);
}

#[test]
fn deviations_are_the_scatter_of_the_result_and_grow_when_the_model_is_wrong() {
    let folder = folder("identify-deviations");
    let sampled = reading(Voltages::Sampled);
    let of = |iron: &IronSettings, seed: u64, from: f64| {
        let path = written(&folder, "a.csv", &on_the_mains(iron, 5000.0, steps(), seed));
        let reading = Reading { times: [Some(from), None], ..sampled.clone() };
        let metrics = identified(&path, &reading).expect("a motor").metrics;
        ["r_s_ohm", "sigma_l_s_mh", "r_s_deviation_ohm", "sigma_l_s_deviation_mh"]
            .map(|name| metrics.get(name).expect(name))
    };
    let all: Vec<_> = (0..6).map(|seed| of(&IronSettings::LINEAR, seed, 0.0)).collect();
    for n in 0..2 {
        let mean = |of: &dyn Fn(&[f64; 4]) -> f64| all.iter().map(of).sum::<f64>() / 6.0;
        let middle = mean(&|x| x[n]);
        let scatter = (mean(&|x| (x[n] - middle).powi(2)) * 6.0 / 5.0).sqrt();
        let stated = mean(&|x| x[n + 2]);
        assert!((0.4..2.5).contains(&(stated / scatter)), "{stated} for {scatter}");
    }
    // With saturating leakage inductances, parts of one record differ by far more than its noise.
    let saturating = IronSettings {
        leakage_saturation: 0.05,
        rotor_leakage_saturation: 0.05,
        ..IronSettings::LINEAR
    };
    let [whole, part] = [0.0, 0.25].map(|from| of(&saturating, 1, from));
    for n in 0..2 {
        let apart = (whole[n] - part[n]).abs();
        assert!(apart < 3.0 * whole[n + 2].hypot(part[n + 2]), "{whole:?} and {part:?}");
        assert!(whole[n + 2] > 5.0 * all[0][n + 2], "{whole:?}");
    }
}

/// A start of the plant itself is reproduced to within its noise; with unsaturated leakage inductances it is not.
#[test]
fn a_recorded_start_is_compared() {
    let folder = folder("measured-start");
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../motors/measured/laboratory-4kw.toml");
    let motor = Config::of_motor(Some(file)).expect("a motor");
    let mut plant = plant_settings(&motor);
    plant.mechanics.load = steps()[0];
    let (iron, shaft) = (plant.iron.expect("iron"), Mechanics::new(&plant.mechanics).unwrap());
    let machine = EnergyMachine::new(&plant.machine, &iron).expect("a machine");
    let mut start = MotorModel::new(machine, shaft);
    let (mut rows, mut random) = (Vec::new(), Xoshiro256PlusPlus::seed_from_u64(1));
    let v = |t: f64| Complex::from_polar(326.6, TAU * 50.0 * t);
    for k in 0..2000 {
        let t = f64::from(k) / 5000.0;
        let i = start.state.electrical.current() + noise(&mut random, 0.03);
        rows.push((t, v(t), i, start.state.speed * 60.0 / TAU));
        (0..8).for_each(|n| start.step(v(t + (f64::from(n) + 0.5) * 25e-6), 25e-6));
    }
    let path = written(&folder, "start.csv", &rows);
    let path = path.to_str().expect("letters");
    for (more, bounds) in
        [(&[][..], 0.0..2.0), (&["--set", "iron.leakage_saturation=0"], 20.0..90.0)]
    {
        let run = ["run", "measured-start", "--input", path, "--motor", file, "--json"];
        let output = hil_sim(&folder, &[&run[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let share = object(&output)["metrics"]["start_current_percent"].as_f64().expect("a share");
        assert!(bounds.contains(&share), "{share} %");
    }
}

/// With a nameplate the motor of a trace loads; without one it is refused.
#[test]
fn the_passport_of_a_trace_is_a_motor() {
    let folder = folder("identify-passport");
    written(&folder, "a.csv", &on_the_mains(&IronSettings::LINEAR, 5000.0, steps(), 3));
    let made = |more: &[&str]| {
        let trace = ["identify-trace", "--input", "a.csv", "--voltages", "sampled"];
        hil_sim(&folder, &[&trace[..], &["--json", "--passport", "a.json"], more].concat())
    };
    let output = made(&["--motor", "buildings-4kw"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let path = folder.join("a.json");
    let motor = Config::of_motor(path.to_str()).expect("a motor");
    for (found, truth) in [
        (motor.motor.r_s, MOTOR.rs),
        (motor.motor.r_r, MOTOR.rr),
        (motor.motor.l_ls, MOTOR.lls),
        (motor.motor.l_m, MOTOR.lm),
    ] {
        assert!((found / truth - 1.0).abs() < 0.02, "{found}, true {truth}");
    }
    assert_eq!((motor.inverter.dc_link_v, motor.drive.nameplate.speed_rpm), (540.0, 1430.0));
    let output = made(&[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("--motor"), "{}", text(&output.stderr));
    let whole = std::fs::read_to_string(&path).unwrap();
    let lacking = whole.lines().filter(|line| !line.contains("pole_pairs")).collect::<Vec<_>>();
    std::fs::write(&path, lacking.join("\n")).unwrap();
    let error = Config::of_motor(path.to_str()).unwrap_err().to_string();
    assert!(error.contains("these are missing: motor.pole_pairs"), "{error}");
}
