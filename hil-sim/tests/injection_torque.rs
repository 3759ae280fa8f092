//! Torque ripple of the injection: the figure that the program shows, the simulated motor, and an independent integration of the machine's
//! equations agree.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use drive_core::{Command, Mode};
use drive_settings::{InjectionAxis, Settings};
use hil_sim::Config;
use hil_sim::config::motors::Motor;
use hil_sim::config::{LoadMode, plant_settings};
use hil_sim::experiments;
use hil_sim::plant::{Complex, Machine, MachineState};
use hil_sim::rig::Rig;

/// Rate of the control, Hz, and of the independent integration.
const RATE: usize = 6000;
const FINE: usize = 1_000_000;

/// Returns the amplitude at 600 Hz of values that are sampled at a rate over whole injection periods.
fn at_600_hz(values: &[f64], rate: usize) -> f64 {
    let turn = |k: usize| Complex::from_polar(1.0, -TAU * 600.0 * k as f64 / rate as f64);
    let sum: Complex = values.iter().enumerate().map(|(k, value)| turn(k) * *value).sum();
    2.0 * sum.norm() / values.len() as f64
}

/// Integrates stator current and rotor flux of the locked machine in the stator's frame, by the T circuit, in steps of 1 us. Along the flux the voltage carries the d-axis current, across it there is the injection, which changes once a control period.
fn integrated(settings: &Settings) -> f64 {
    let m = &settings.motor;
    let [r_s, r_r, l_ls, l_lr, l_m] = [m.r_s, m.r_r, m.l_ls, m.l_lr, m.l_m].map(f64::from);
    let (l_s, l_r) = (l_m + l_ls, l_m + l_lr);
    let [i_d, volts] = [settings.i_d(), settings.carrier_v()].map(f64::from);
    let (mut i, mut psi) = (Complex::new(i_d, 0.0), Complex::new(l_m * i_d, 0.0));
    let mut torques = Vec::new();
    for k in 0..FINE / 5 {
        let injection = volts * (TAU * 600.0 * (k * RATE / FINE) as f64 / RATE as f64).sin();
        let v = Complex::new(r_s * i_d, injection);
        let d_psi = (i * l_m - psi) * (r_r / l_r);
        let d_i = (v - i * r_s - d_psi * (l_m / l_r)) / (l_s - l_m * l_m / l_r);
        (i, psi) = (i + d_i / FINE as f64, psi + d_psi / FINE as f64);
        torques.push(1.5 * f64::from(m.pole_pairs) * l_m / l_r * (psi.conj() * i).im);
    }
    // The second half, without the transient of the first periods: 60 injection periods.
    at_600_hz(&torques[FINE / 10..], FINE)
}

/// Integrates the injection current of the locked machine with its saliency, with the injection along the flux and a constant torque, in
/// steps of 1 us.
fn integrated_along_flux(config: &Config, i_q: f64) -> f64 {
    let (plant, m) = (plant_settings(config), &config.drive.motor);
    let machine = Machine::new(&plant.machine, &plant.saliency).unwrap();
    let [r_s, r_r, l_lr, l_m, sigma_ls] =
        [m.r_s, m.r_r, m.l_lr, m.l_m, m.sigma_l_s()].map(f64::from);
    let [i_d, volts] = [config.drive.i_d(), config.drive.carrier_v()].map(f64::from);
    let (share, i_0) = (l_m / (l_m + l_lr), Complex::new(i_d, i_q));
    let (mut i, mut torques) = (Complex::ZERO, Vec::new());
    for k in 0..FINE / 5 {
        let injection = volts * (TAU * 600.0 * (k * RATE / FINE) as f64 / RATE as f64).sin();
        let y = Complex::new(injection, 0.0) - i * (r_s + r_r * share * share);
        let x = MachineState { i: i_0 + i, psi: Complex::new(l_m * i_d, 0.0), i_lp: i_0 };
        let s = machine.saliency(&x);
        i += (y + s * y.conj()) / (sigma_ls * (1.0 - s.norm_sqr())) / FINE as f64;
        torques.push(1.5 * f64::from(m.pole_pairs) * share * l_m * i_d * i.im);
    }
    at_600_hz(&torques[FINE / 10..], FINE)
}

/// Returns the torque ripple of the drive on its simulated motor, with a locked shaft and a q-axis current.
fn simulated(mut rig: Rig, i_q: f64) -> f64 {
    rig.start(Mode::Torque).expect("a learned drive");
    rig.settle(&Command::Torque(i_q as f32), 1.0).expect("a torque");
    let torques: Vec<_> = (0..RATE).map(|_| (rig.step(), rig.plant.torque()).1).collect();
    assert_eq!(rig.fault(), None);
    at_600_hz(&torques, RATE)
}

#[test]
fn the_shown_torque_ripple_is_that_of_the_motor() {
    for name in ["dissertation", "motulator-2kw2", "krause-3hp", "spindle-2kw2"] {
        let mut config = Config::of_motor(Some(name)).unwrap();
        config.load.mode = LoadMode::Locked;
        let shown = f64::from(config.drive.injection_nm(&config.drive.reference()));
        let simulated = simulated(Rig::from_config(&config, 1).unwrap(), 0.0);
        for (by, nm) in [("integrated", integrated(&config.drive)), ("simulated", simulated)] {
            assert!((nm / shown - 1.0).abs() < 0.1, "{name}: shown {shown} Nm, {by} {nm} Nm");
        }
    }
}

/// On the d axis the torque ripple at rated torque follows from the saliency offset, which the drive has learned. An angle error of 1°
/// adds up to 1.7 % of the torque that the same current makes on the q axis.
#[test]
fn the_shown_torque_ripple_along_the_flux_is_that_of_the_motor() {
    for name in ["motulator-2kw2", "laboratory-3kw-8p"] {
        let mut config = Config::of_motor(Some(name)).unwrap();
        (config.load.mode, config.prepare.learn) = (LoadMode::Locked, false);
        config.drive.injection.axis = InjectionAxis::D;
        let drive = &config.drive;
        let mut rig = Rig::from_config(&config, 1).unwrap();
        let learned = rig.learn().expect("a saliency");
        rig.wait(2.0);
        let shown = f64::from(drive.injection_nm(&learned.reference));
        let per_ampere = f64::from(drive.motor.torque_per_ampere(drive.i_d()));
        let i_q = config.rated_nm() / per_ampere;
        let integrated = integrated_along_flux(&config, i_q);
        assert!((integrated / shown - 1.0).abs() < 0.1, "{name}: {shown}, {integrated} Nm");
        let by_angle = 0.017 * per_ampere * f64::from(drive.injection_a());
        let simulated = simulated(rig, i_q);
        assert!((simulated - shown).abs() < 0.1 * shown + by_angle, "{name}: {shown}, {simulated}");
    }
}

/// Returns the largest torque ripple in torque steps up to the rated torque, % of it, and the angle error, settled rms and largest,
/// degrees; none if the axis is refused.
fn steps(config: &Config) -> Option<[f64; 3]> {
    let mut config = config.clone();
    (config.load.mode, config.prepare.learn) = (LoadMode::Locked, true);
    let drive = &config.drive;
    let rated_a = config.rated_nm() / f64::from(drive.motor.torque_per_ampere(drive.i_d()));
    config.reference.iq_a = Some(0.5 * rated_a);
    let run = experiments::run("injection-ripple", &config, 1).ok()?;
    assert_eq!(run.faults, Vec::<String>::new());
    let get = |name| run.metrics.get(name).unwrap();
    let pct = 100.0 * get("torque_ripple_max_nm") / config.rated_nm();
    Some([pct, get("angle_error_settled_rms_deg"), get("angle_error_max_deg")])
}

/// Returns the rows of the table of `docs/noise.md`, with both axes of every motor. The ripple on the q axis is within the bound of the
/// settings, and on the d axis it is at most 3 % of the rated torque on five motors at least; the angle errors at rest are at most 2° rms.
pub fn rows() -> String {
    let (mut rows, mut quiet) = (String::new(), 0);
    for Motor { name, .. } in Motor::all() {
        let mut config = Config::of_motor(Some(&name)).unwrap();
        let [volts, amperes] = [config.drive.carrier_v(), config.drive.injection_a()];
        let at_rest = 100.0 * config.drive.injection_nm(&config.drive.reference());
        let (rated, bound) = (config.rated_nm() as f32, config.drive.injection.torque_pct);
        let (at_rest, pct) = (at_rest / rated, 100.0 * amperes / config.drive.rated_a());
        let q = steps(&config).expect("a saliency");
        config.drive.injection.axis = InjectionAxis::D;
        let d = steps(&config);
        assert!(at_rest <= bound, "{name}: {at_rest} %");
        assert!(q[1] <= 2.0 && d.is_none_or(|d| d[1] <= 2.0), "{name}: {q:?} {d:?}");
        quiet += u32::from(d.is_some_and(|d| d[0] <= 3.0));
        write!(rows, "| `{name}` | {volts:.1} | {amperes:.3} | {pct:.0} | {at_rest:.0} |").unwrap();
        for seen in [Some(q), d] {
            let cells = seen
                .map(|[ripple, rms, largest]| format!(" {ripple:.1} | {rms:.1} / {largest:.1} |"));
            rows += &cells.unwrap_or_else(|| " refused | - |".to_owned());
        }
        rows.push('\n');
    }
    assert!(quiet >= 5, "{quiet} motors");
    rows
}
