//! Tests of the saliency that an injected voltage measures, and of the settings that are refused.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use motor_plant::{
    Complex, Load, Machine, MachineModel, MachineSettings, MachineState, Mechanics,
    MechanicsSettings, MotorModel, Plant, PlantSettings, SaliencySettings,
};

const FREQUENCY: f64 = 600.0;
const STEPS: u32 = 50;

/// Current phasor (cosine reference) at 600 Hz, A, in the stator frame, as two complex amplitudes along and across the
/// injection axis. The rotor is locked, with the rotor flux of `id` along alpha; the injected voltage is `v` V peak at
/// this angle from it.
fn injected(saliency: SaliencySettings, id: f64, v: f64, angle: f64) -> [Complex; 2] {
    let machine = Machine::new(&MachineSettings::default(), &saliency).expect("machine");
    let locked = MechanicsSettings { load: Load::Locked, ..Default::default() };
    let mut motor = MotorModel::new(machine, Mechanics::new(&locked).expect("shaft"));
    let dc = Complex::new(5.4 * id, 0.0);
    // Six rotor time constants (186 ms).
    for _ in 0..12_000 {
        motor.step(dc, 1e-4);
    }
    let axis = Complex::from_polar(1.0, angle);
    let mean = motor.state.electrical.i;
    let h = 1.0 / (FREQUENCY * f64::from(STEPS));
    let mut phasors = [Complex::ZERO; 2];
    // 0.1 s for the decay of the 8 ms transient, then 60 cycles.
    for k in 0..120 * STEPS {
        // Voltage at the middle of the step, phase measured at its end.
        let v = v * (TAU * (f64::from(k) + 0.5) / f64::from(STEPS)).cos();
        motor.step(dc + axis * v, h);
        if k >= 60 * STEPS {
            let local = (motor.state.electrical.i - mean) * axis.conj();
            let reference = Complex::from_polar(
                2.0 / f64::from(60 * STEPS),
                -TAU * f64::from(k + 1) / f64::from(STEPS),
            );
            phasors[0] += reference * local.re;
            phasors[1] += reference * local.im;
        }
    }
    phasors
}

#[test]
fn textbook_machine_has_its_impedance_at_600_hz() {
    let [along, across] = injected(SaliencySettings::NONE, 0.0, 50.0, 0.3);
    let j_omega = Complex::new(0.0, TAU * FREQUENCY);
    let magnetising = j_omega * 0.1771;
    let rotor = j_omega * 0.0276 + 1.1;
    let z = j_omega * 0.0276 + 5.4 + magnetising * rotor / (magnetising + rotor);
    let expected = 50.0 / z;
    // The staircase of 50 steps a cycle has sinc(1/50) = 0.99934 of the fundamental.
    assert!((along / expected - 1.0).norm() < 2e-3, "{along} instead of {expected}");
    assert!((along.norm() - 0.258).abs() < 1e-3, "{} A", along.norm());
    assert!(across.norm() < 1e-5 * along.norm(), "nothing across: {across}");
}

#[test]
fn a_saliency_fixed_to_the_stator_needs_no_flux() {
    let s =
        SaliencySettings { stator_fixed: 0.01, stator_fixed_deg: 30.0, ..SaliencySettings::NONE };
    let axis = FRAC_PI_2 / 3.0;
    let [low, high] = [axis, axis + FRAC_PI_2].map(|angle| injected(s, 0.0, 50.0, angle));
    let ratio = low[0].norm() / high[0].norm();
    assert!((ratio - 1.01 / 0.99).abs() < 1e-4, "{ratio}");
}

#[test]
fn the_flux_axis_has_the_high_impedance() {
    let s = SaliencySettings::default();
    let [d, _] = injected(s, 0.7, 1.0, 0.0);
    let [q, _] = injected(s, 0.7, 1.0, FRAC_PI_2);
    // Small signal, current along the flux: s = a_psi + b1 0.7 A = -0.0098, and the ratio of the currents is (1 + s) to
    // (1 - s).
    let ratio = d.norm() / q.norm();
    assert!(d.norm() < q.norm(), "d must have the higher impedance");
    assert!((ratio - (1.0 - 0.0098) / (1.0 + 0.0098)).abs() < 5e-4, "{ratio}");
    // If the flux part has the opposite sign, the order is reversed.
    let opposite = SaliencySettings { a_psi: 0.035, ..s };
    let d = injected(opposite, 0.7, 1.0, 0.0)[0].norm();
    let q = injected(opposite, 0.7, 1.0, FRAC_PI_2)[0].norm();
    assert!(d > q, "{d} {q}");
}

#[test]
fn chi_is_the_resistive_saliency_of_eq_3_8() {
    let s = SaliencySettings { chi: 1.0, ..SaliencySettings::NONE };
    let [along, across] = injected(s, 0.7, 5.0, FRAC_PI_4);
    let quadrature = across / along;
    // Halfway between the axes: half of rr (Lm/Lr)^2 against Omega sigma Ls, in quadrature.
    let omega_sigma_ls = TAU * FREQUENCY * (0.2047 - 0.1771 * 0.1771 / 0.2047);
    let expected = 0.5 * 1.1 * (0.1771f64 / 0.2047).powi(2) / omega_sigma_ls;
    // The split at 60 Hz rotates it by atan(60/600) = 6 degrees and reduces it by 1 %.
    assert!((quadrature.im.abs() / expected - 1.0).abs() < 0.03, "{quadrature}");
    assert!(quadrature.re.abs() < 0.15 * expected, "{quadrature}");
}

#[test]
fn the_inductance_is_the_tensor_of_the_model() {
    let (m, settings) = (MachineSettings::default(), SaliencySettings::default());
    let machine = Machine::new(&m, &settings).expect("machine");
    let textbook = Machine::new(&m, &SaliencySettings::NONE).expect("machine");
    let psi_n = 0.7 * m.lm;
    for n in 0..200 {
        let n = f64::from(n);
        let (i_length, i_angle) = (0.02 + 0.024 * n, 0.7 * n);
        let (psi_length, psi_angle) = (0.004 * n, 1.9 * n);
        let x = MachineState {
            i: Complex::from_polar(i_length, i_angle),
            psi: Complex::from_polar(psi_length, psi_angle),
            i_lp: Complex::ZERO,
        };
        // s = a_psi (psi/psi_n)^2 2/(1 + r) + b1 i^2/|i|, from magnitudes and angles.
        let r = (psi_length / psi_n).powi(2);
        let s = Complex::from_polar(1.0, 2.0 * psi_angle) * (-0.035 * r * 2.0 / (1.0 + r))
            + Complex::from_polar(0.036 * i_length, 2.0 * i_angle);
        assert!((machine.saliency(&x) - s).norm() < 1e-14, "{} {s}", machine.saliency(&x));
        // The voltage that remains for the transient inductance is that of the textbook machine; sigma Ls (x - s x*) of
        // the current's rate must give the same voltage.
        let v = Complex::from_polar(100.0, n);
        let (rate, plain) = (machine.derivative(&x, v, 50.0), textbook.derivative(&x, v, 50.0));
        let left = rate.i - s * rate.i.conj();
        assert!((left - plain.i).norm() < 1e-12 * plain.i.norm(), "{left} {}", plain.i);
        assert_eq!(rate.psi, plain.psi);
    }
}

#[test]
fn the_saliency_stays_below_half() {
    let (m, s) = (MachineSettings::default(), SaliencySettings::default());
    let machine = Machine::new(&m, &s).expect("machine");
    let mut worst = 0f64;
    for step in 0..=50 {
        for turn in 0..36 {
            let flux = 0.02 * f64::from(step) * m.lm * SaliencySettings::default().hold_a;
            let psi = Complex::from_polar(flux, TAU * f64::from(turn) / 36.0);
            // Up to four times the current for which the settings are checked.
            for i in [0.0, 1e-12, 0.7, 3.0, 5.0, 20.0] {
                let x = MachineState { i: i.into(), psi, i_lp: Complex::ZERO };
                worst = worst.max(machine.saliency(&x).norm());
            }
        }
    }
    // 2 |a_psi| R/(1 + R) + b1 5 A with R = 51: 0.0686 + 0.18.
    assert!(worst < 0.25, "{worst}");
}

fn refusal(change: impl Fn(&mut PlantSettings)) -> String {
    let mut settings = PlantSettings::default();
    change(&mut settings);
    Plant::new(&settings, 0).expect_err("must be refused").to_string()
}

#[test]
fn refusals_name_the_setting_its_value_and_its_range() {
    let text = refusal(|s| s.saliency.b1 = 0.095);
    // (0.5 - 0.0686)/5
    for part in ["saliency.b1", "0.095", "-0.086", "to 0.086"] {
        assert!(text.contains(part), "{part} in: {text}");
    }
    let text = refusal(|s| s.saliency.a_psi = -0.2);
    for part in ["saliency.a_psi", "-0.2", "0.163", "0.572"] {
        assert!(text.contains(part), "{part} in: {text}");
    }
    let text = refusal(|s| s.machine.rs = f64::NAN);
    assert_eq!(text, "machine.rs = NaN is outside the allowed range 0.0001 to 1000 ohm");
    let text = refusal(|s| s.measurement.lsb_a = 0.0001);
    // With a range of 4.4727 A: 16 to 7 bits.
    let begin = "measurement.lsb_a = 0.0001 is outside the allowed range 0.00013977";
    assert!(text.starts_with(begin) && text.ends_with(" to 0.0559089175 A"), "{text}");
    type Change = fn(&mut PlantSettings);
    let others: [(&str, Change); 10] = [
        ("machine.rr", |s| s.machine.rr = 0.0),
        ("machine.lls", |s| s.machine.lls = -0.01),
        ("machine.llr", |s| s.machine.llr = f64::INFINITY),
        ("machine.lm", |s| s.machine.lm = 0.0),
        ("machine.pole_pairs", |s| s.machine.pole_pairs = 0),
        ("saliency.psi_n", |s| s.saliency.psi_n = Some(0.0)),
        ("mechanics.inertia", |s| s.mechanics.inertia = 0.0),
        ("mechanics.load.torque", |s| s.mechanics.load = Load::Free { torque: f64::NAN }),
        ("inverter.vdc", |s| s.inverter.vdc = -1.0),
        ("substeps", |s| s.substeps = 0),
    ];
    for (key, change) in others {
        let text = refusal(change);
        assert!(text.starts_with(&format!("{key} = ")), "{key}: {text}");
    }
}

#[test]
fn settings_are_read_from_toml_with_defaults_and_without_typing_errors() {
    let text =
        "substeps = 4\n[saliency]\nb1 = 0.0\n[mechanics]\nload = { mode = 'speed', speed = 3.0 }";
    let read: PlantSettings = toml::from_str(text).expect("valid");
    let expected = PlantSettings {
        machine: MachineSettings::default(),
        saliency: SaliencySettings { b1: 0.0, ..Default::default() },
        mechanics: MechanicsSettings { load: Load::Speed { speed: 3.0 }, ..Default::default() },
        substeps: 4,
        ..PlantSettings::default()
    };
    assert_eq!(read, expected);
    let again: PlantSettings = toml::from_str(&toml::to_string(&read).expect("text")).expect("own");
    assert_eq!(again, expected);
    for wrong in ["[saliency]\nb2 = 0.0", "[inverter]\nvcd = 1.0", "steps = 1"] {
        assert!(toml::from_str::<PlantSettings>(wrong).is_err(), "{wrong}");
    }
}
