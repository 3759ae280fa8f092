//! Checks of the energy model against the equivalent circuit, its own energy, and model A.

use std::f64::consts::TAU;

use drive_core::Compare;
use motor_plant::{
    Complex, ElectricalState as _, EnergyMachine, FAMILIES, InverterSettings, IronSettings, Load,
    MachineModel as _, MachineSettings, MeasurementSettings, Mechanics, MechanicsSettings,
    MotorModel, Plant, PlantSettings, SaliencySettings,
};

const M: MachineSettings =
    MachineSettings { rs: 5.4, rr: 1.1, lls: 0.0276, llr: 0.0276, lm: 0.1771, pole_pairs: 2 };
const J: Complex = Complex::new(0.0, 1.0);

/// All terms at once that are gradients of the energy.
const ALL: IronSettings = IronSettings {
    saturation: 1.3,
    teeth: -0.035,
    leakage_saturation: 0.15,
    rotor_leakage_saturation: 0.1,
    skin_ratio: 3.5,
    skin_leakage: 0.010,
    slots: 0.003,
    stator_fixed: 0.003,
    stator_fixed_deg: 25.0,
    loss: 1500.0,
    ..IronSettings::LINEAR
};

fn family(name: &str) -> IronSettings {
    FAMILIES.iter().find(|family| family.name == name).expect(name).iron
}

fn motor(iron: &IronSettings, load: Load) -> MotorModel<EnergyMachine> {
    let mechanics = MechanicsSettings { load, ..MechanicsSettings::default() };
    let machine = EnergyMachine::new(&M, iron).expect("machine");
    MotorModel::new(machine, Mechanics::new(&mechanics).expect("shaft"))
}

/// Energy that is missing after 0.3 s of a voltage of 60 V at 15 Hz with a superposed voltage of 50 V at 600 Hz, and
/// the energy fed in, J.
fn missing(iron: &IronSettings, steps_per_period: u32) -> (f64, f64) {
    let mut motor = motor(iron, Load::Free { torque: 0.3 });
    let h = 1.0 / 6000.0 / f64::from(steps_per_period);
    let (mut fed, mut spent) = (0.0, 0.0);
    // Powers by the trapezoidal rule, at a voltage that is constant within a step.
    for k in 0..(0.3 / h).round() as u32 {
        let t = (f64::from(k) + 0.5) * h;
        let v = Complex::cis(TAU * 15.0 * t) * 60.0 + (TAU * 600.0 * t).cos() * 50.0;
        let powers = |motor: &MotorModel<EnergyMachine>| {
            let x = &motor.state.electrical;
            let shaft = motor.machine.torque(x) * motor.state.speed;
            [1.5 * (v.conj() * x.current()).re, motor.machine.losses(x) + shaft]
        };
        let before = powers(&motor);
        motor.step(v, h);
        let after = powers(&motor);
        fed += 0.5 * h * (before[0] + after[0]);
        spent += 0.5 * h * (before[1] + after[1]);
    }
    (fed - spent - motor.machine.energy(&motor.state.electrical), fed)
}

#[test]
fn no_term_makes_energy() {
    let rest: Vec<f64> = [2, 4, 8, 16].map(|steps| missing(&ALL, steps).0.abs()).into();
    let fed = missing(&ALL, 16).1;
    // The error is of at least first order, and almost nothing remains: less than 1e-5 of the energy.
    for pair in rest.windows(2) {
        assert!(pair[1] < 0.6 * pair[0], "{rest:?}");
    }
    assert!(fed > 5.0 && rest[3] < 1e-5 * fed, "{rest:?} of {fed} J");
    // The one exception: teeth that follow the rotor flux alone. Their error is bounded, not zero.
    for name in ["r", "rl"] {
        let r = family(name);
        assert!(!r.conservative() && ALL.conservative());
        let (lost, fed) = missing(&r, 16);
        assert!(lost.abs() > 1e-4 * fed && lost.abs() < 0.05 * fed, "{lost} of {fed} J");
    }
    let (lost, fed) = missing(&family("gl"), 16);
    assert!(lost.abs() < 1e-5 * fed, "{lost} of {fed} J");
}

/// Current and torque of the T circuit at this voltage (peak phase value), frequency and slip.
fn circuit(iron: &IronSettings, v: f64, hz: f64, slip: f64) -> (Complex, f64) {
    let w = TAU * hz;
    let bar = if iron.skin_ratio > 1.0 {
        let (k, share) = (iron.skin_ratio, 1.0 - 1.0 / iron.skin_ratio);
        let top = Complex::from(k * M.rr / slip);
        let bottom = M.rr / share / slip + J * w * (iron.skin_leakage / (share * share));
        J * w * (M.llr - iron.skin_leakage) + top * bottom / (top + bottom)
    } else {
        J * w * M.llr + M.rr / slip
    };
    let main = J * w * M.lm;
    let parallel = main * bar / (main + bar);
    let i = v / (M.rs + J * w * M.lls + parallel);
    let air_gap = 1.5 * (i.norm_sqr() * parallel.re);
    (i, air_gap / (w / f64::from(M.pole_pairs)))
}

#[test]
fn a_linear_motor_is_the_equivalent_circuit() {
    let skin = IronSettings { skin_ratio: 3.5, skin_leakage: 0.010, ..IronSettings::LINEAR };
    for iron in [IronSettings::LINEAR, skin] {
        let (hz, slip, v) = (10.0, 0.363, 30.0);
        let speed = TAU * hz * (1.0 - slip) / f64::from(M.pole_pairs);
        let mut motor = motor(&iron, Load::Speed { speed });
        let h = 1.0 / 24_000.0;
        let steps = 48_000;
        for k in 0..steps {
            motor.step(Complex::cis(TAU * hz * (f64::from(k) + 0.5) * h) * v, h);
        }
        let x = &motor.state.electrical;
        let turned = x.current() * Complex::cis(-TAU * hz * f64::from(steps) * h);
        let (i, torque) = circuit(&iron, v, hz, slip);
        let found = motor.machine.torque(x);
        assert!((turned - i).norm() < 1e-4 * i.norm(), "{turned} for {i} A");
        assert!((found / torque - 1.0).abs() < 1e-4, "{found} for {torque} Nm");
    }
}

/// Impedances at 600 Hz along and across phase a, ohm, from a small injected voltage at rest.
fn at_600_hz(iron: &IronSettings) -> [Complex; 2] {
    [Complex::from(1.0), J].map(|axis| {
        let mut motor = motor(iron, Load::Locked);
        let (h, per_cycle) = (1.0 / (600.0 * 400.0), 400);
        let mut sum = Complex::ZERO;
        for k in 0..per_cycle * 240 {
            let phase = TAU * (f64::from(k) + 0.5) / f64::from(per_cycle);
            motor.step(axis * phase.cos(), h);
            // Only the last forty cycles count: the switch-on transient has decayed by then, or averages out.
            if k >= per_cycle * 200 {
                let i = (axis.conj() * motor.state.electrical.current()).re;
                sum += Complex::cis(-phase - 0.5 * TAU / f64::from(per_cycle)) * i;
            }
        }
        1.0 / (sum * (2.0 / f64::from(per_cycle * 40)))
    })
}

#[test]
fn a_linear_motor_has_no_saliency() {
    let [along, across] = at_600_hz(&IronSettings::LINEAR);
    let saliency = (across - along).norm() / (across + along).norm();
    let sigma_ls = M.lls + M.lm - M.lm * M.lm / (M.lm + M.llr);
    let found = along.im / (TAU * 600.0);
    assert!(saliency < 1e-12, "{saliency:e}");
    // The tolerance covers the staircase of 400 steps a cycle and the rest of the transient.
    assert!((found / sigma_ls - 1.0).abs() < 1e-3, "{found} for {sigma_ls} H");
}

/// Runs a plant: outputs on at a rotating voltage with an injected voltage, then off.
fn run(settings: &PlantSettings, periods: u32) -> Vec<Complex> {
    let mut plant = Plant::new(settings, 1).expect("plant");
    let top = f64::from(settings.inverter.timer_top);
    let mut currents = Vec::new();
    for k in 0..periods {
        let t = f64::from(k) / 6000.0;
        let v = Complex::cis(TAU * 20.0 * t) * 70.0 + (TAU * 600.0 * t).cos() * 50.0;
        let legs = motor_plant::phases(v).map(|v| ((0.5 + v / 311.0) * top) as u16);
        let [a, b, c] = legs;
        let on = k < periods * 4 / 5;
        plant.advance(&Compare { a, b, c, enabled: on }, 1.0 / 6000.0);
        currents.push(plant.current());
    }
    currents
}

fn worst(a: &[Complex], b: &[Complex]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

#[test]
fn linear_iron_is_model_a_without_saliency() {
    let textbook = PlantSettings { saliency: SaliencySettings::NONE, ..Default::default() };
    for switched in [false, true] {
        let inverter = InverterSettings { switched, ..textbook.inverter };
        let a = run(&PlantSettings { inverter, substeps: 8, ..textbook }, 1500);
        let iron = Some(IronSettings::LINEAR);
        let b = run(&PlantSettings { iron, inverter, substeps: 8, ..textbook }, 1500);
        // With the outputs off, the last currents are exactly zero in both.
        assert_eq!(a.last(), b.last());
        assert!(worst(&a, &b) < 2e-6, "{:e} A", worst(&a, &b));
    }
}

#[test]
fn two_steps_a_period_are_enough() {
    // Teeth on the rotor flux are not a gradient, and have rates of their own.
    for iron in [ALL, family("r"), family("rl"), family("gl")] {
        let settings = PlantSettings {
            iron: Some(iron),
            inverter: InverterSettings::IDEAL,
            measurement: MeasurementSettings::IDEAL,
            ..Default::default()
        };
        // This holds only while the outputs are on; with the outputs off, the instants at which diodes stop conducting matter.
        let on = |substeps| {
            let mut currents = run(&PlantSettings { substeps, ..settings }, 1200);
            currents.truncate(960);
            currents
        };
        let exact = on(64);
        let errors = [2, 4, 8].map(|substeps| worst(&on(substeps), &exact));
        // An error of fourth order leaves 1/256; with a missing rate it is of first order and leaves a quarter.
        assert!(errors[0] < 5e-5 && errors[2] < 0.02 * errors[0], "{errors:?}");
    }
}

#[test]
fn refusals_name_the_setting() {
    type Case = (&'static str, fn(&mut IronSettings));
    let cases: [Case; 7] = [
        ("iron.saturation", |s| s.saturation = 0.9),
        ("iron.exponent", |s| s.exponent = 0),
        ("iron.teeth", |s| s.teeth = 0.3),
        ("iron.skin_leakage", |s| s.skin_leakage = 0.05),
        ("iron.loss", |s| s.loss = f64::NAN),
        ("iron.leakage_saturation", |s| s.leakage_saturation = -1.0),
        ("iron.nominal_a", |s| s.nominal_a = -1.0),
    ];
    for (name, change) in cases {
        let mut iron = IronSettings::LINEAR;
        change(&mut iron);
        let text = EnergyMachine::new(&M, &iron).expect_err(name).to_string();
        assert!(
            text.starts_with(&format!("{name} = ")) && text.contains("allowed range"),
            "{text}"
        );
    }
}
