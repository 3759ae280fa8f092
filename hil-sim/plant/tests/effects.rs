//! Every effect that can be switched on, by what it does to the physics.

use std::f64::consts::TAU;

use drive_core::Compare;
use motor_plant::{
    Complex, DcLinkSettings, ElectricalState as _, EnergyMachine, FAMILIES, InverterSettings,
    IronSettings, Load, MachineModel as _, MachineSettings, MeasurementSettings, Mechanics,
    MechanicsSettings, MotorModel, Plant, PlantSettings, WarmingSettings, phases,
};

const T: f64 = 1.0 / 6000.0;

fn settings() -> PlantSettings {
    let mut settings = PlantSettings {
        iron: Some(IronSettings::LINEAR),
        inverter: InverterSettings::IDEAL,
        measurement: MeasurementSettings::IDEAL,
        ..PlantSettings::default()
    };
    settings.mechanics.load = Load::Locked;
    settings
}

fn plant(settings: &PlantSettings) -> Plant {
    Plant::new(settings, 7).expect("plant")
}

/// Duties that give the voltage `v`, V, at 311 V.
fn compare(v: Complex) -> Compare {
    let [a, b, c] = phases(v).map(|v| ((0.5 + v / 311.0) * 14_167.0).round() as u16);
    Compare { a, b, c, enabled: true }
}

/// The plant after `seconds` of a constant voltage.
fn held(settings: &PlantSettings, v: Complex, seconds: f64) -> Plant {
    let mut plant = plant(settings);
    for _ in 0..(seconds / T) as u32 {
        plant.advance(&compare(v), T);
    }
    plant
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found}, expected {expected} ± {tolerance}");
}

/// Inductance at 600 Hz along an axis, H, with the rotor at an electrical angle.
fn inductance(iron: &IronSettings, axis_deg: f64, theta: f64) -> f64 {
    let machine = EnergyMachine::new(&MachineSettings::default(), iron).expect("machine");
    let locked = MechanicsSettings { load: Load::Locked, ..Default::default() };
    let mut motor = MotorModel::new(machine, Mechanics::new(&locked).expect("shaft"));
    motor.state.electrical.theta = theta;
    machine.settle(&mut motor.state.electrical);
    let (axis, per_cycle) = (Complex::cis(axis_deg.to_radians()), 100);
    let mut sum = Complex::ZERO;
    for k in 0..per_cycle * 240 {
        let phase = TAU * (f64::from(k) + 0.5) / f64::from(per_cycle);
        motor.step(axis * phase.cos(), 1.0 / 60_000.0);
        if k >= per_cycle * 200 {
            let i = (axis.conj() * motor.state.electrical.current()).re;
            sum += Complex::cis(-phase - 0.5 * TAU / f64::from(per_cycle)) * i;
        }
    }
    (1.0 / (sum * (2.0 / f64::from(per_cycle * 40)))).im / (TAU * 600.0)
}

#[test]
fn a_stator_fixed_saliency_stays_and_a_slot_saliency_turns_with_the_bars() {
    let saliency = |iron: &IronSettings, axis: f64, theta: f64| {
        let (along, across) = (inductance(iron, axis, theta), inductance(iron, axis + 90.0, theta));
        (across - along) / (across + along)
    };
    let fixed = IronSettings { stator_fixed: 0.01, stator_fixed_deg: 25.0, ..IronSettings::LINEAR };
    // To first order in it.
    near(saliency(&fixed, 25.0, 0.0), 0.01, 3e-4);
    near(saliency(&fixed, 25.0, 1.0), 0.01, 3e-4);
    near(saliency(&fixed, 70.0, 0.0), 0.0, 3e-4);
    let slots = IronSettings { slots: 0.01, bars: 28, ..IronSettings::LINEAR };
    // 28 bars are 14 a pole pair: half a turn of the axis in 2 pi/14 electrical.
    for (theta, axis) in [(0.0, 0.0), (TAU / 28.0, 90.0), (TAU / 56.0, 45.0), (TAU / 14.0, 0.0)] {
        near(saliency(&slots, axis, theta), 0.01, 3e-4);
    }
}

#[test]
fn iron_loss_is_that_of_its_resistance() {
    let mut settings = settings();
    settings.iron = Some(IronSettings { loss: 1000.0, ..IronSettings::LINEAR });
    // At the synchronous speed there is no rotor current.
    settings.mechanics.load = Load::Speed { speed: TAU * 10.0 };
    let mut plant = plant(&settings);
    let (mut input, mut expected) = (0.0, 0.0);
    for k in 0..18_000u32 {
        let before = plant.current();
        plant.advance(&compare(Complex::cis(TAU * 20.0 * f64::from(k) * T) * 100.0), T);
        if k >= 12_000 {
            let motor = plant.energy_model().expect("energy model");
            let main = motor.state.electrical.main_flux();
            let mean = (before + plant.current()) * 0.5;
            input += 1.5 * (mean.conj() * plant.applied_voltage()).re;
            let emf = TAU * 20.0 * main.norm();
            expected += 1.5 * (emf * emf / 1000.0 + 5.4 * plant.current().norm_sqr());
        }
    }
    near(input / expected, 1.0, 0.005);
    assert!(input / 6000.0 > 5.0, "{input}");
}

#[test]
fn bars_have_more_resistance_and_less_leakage_at_high_frequency() {
    let skin = IronSettings { skin_ratio: 3.5, skin_leakage: 0.010, ..IronSettings::LINEAR };
    let (deep, plain) = (inductance(&skin, 0.0, 0.0), inductance(&IronSettings::LINEAR, 0.0, 0.0));
    // The whole 10 mH, seen through the main inductance, less what 600 Hz leave: 43.3 mH of 51.5.
    near(plain - deep, 0.0081, 0.0004);
}

fn shaft(change: impl Fn(&mut MechanicsSettings)) -> MotorModel<EnergyMachine> {
    let machine = EnergyMachine::new(&MachineSettings::default(), &IronSettings::LINEAR);
    let mut settings = MechanicsSettings { friction: 0.0, ..Default::default() };
    change(&mut settings);
    MotorModel::new(machine.expect("machine"), Mechanics::new(&settings).expect("shaft"))
}

/// Runs without voltage, and so without torque.
fn coast(motor: &mut MotorModel<EnergyMachine>, seconds: f64) {
    for _ in 0..(seconds / 1e-4).round() as u32 {
        motor.step(Complex::ZERO, 1e-4);
    }
}

#[test]
fn static_friction_holds_the_shaft_until_it_breaks_away() {
    let with = |torque: f64, speed: f64| {
        let mut motor = shaft(|m| {
            m.static_torque = 0.5;
            m.load = Load::Free { torque };
        });
        motor.state.speed = speed;
        coast(&mut motor, 0.1);
        motor.state.speed
    };
    assert_eq!(with(0.49, 0.0), 0.0);
    assert_eq!(with(-0.49, 0.0), 0.0);
    // Beyond, the rest accelerates 0.012 kg m^2.
    near(with(0.62, 0.0), -0.12 / 0.012 * 0.1, 1e-6);
    // A turning shaft is braked by it, stops and stays.
    near(with(0.0, 10.0), 10.0 - 0.5 / 0.012 * 0.1, 1e-6);
    assert_eq!(with(0.0, 2.0), 0.0);
}

#[test]
fn a_load_once_a_turn_is_a_pendulum() {
    // Load torque T cos(angle): small swings about -90 degrees have w = sqrt(T/J).
    let mut motor = shaft(|m| m.once_torque = 0.3);
    motor.state.angle = -0.25 * TAU + 0.05;
    let period = TAU / (0.3_f64 / 0.012).sqrt();
    coast(&mut motor, 0.5 * period);
    near(motor.state.angle, -0.25 * TAU - 0.05, 1e-3);
    coast(&mut motor, 0.5 * period);
    near(motor.state.angle, -0.25 * TAU + 0.05, 1e-3);
}

#[test]
fn an_elastic_coupling_resonates() {
    let mut motor = shaft(|m| {
        (m.inertia, m.load_inertia, m.stiffness) = (0.003, 0.009, 15.0);
    });
    motor.state.speed = 4.0;
    // Half a period later the motor is as far below the common speed as it was above it.
    let half = 0.5 * TAU / (15.0_f64 * (1.0 / 0.003 + 1.0 / 0.009)).sqrt();
    coast(&mut motor, half);
    let common = 4.0 * 0.003 / 0.012;
    near(motor.state.speed, 2.0 * common - 4.0, 0.02);
    let load = motor.mechanics.load_speed().expect("coupling");
    near(0.003 * motor.state.speed + 0.009 * load, 0.012, 1e-4);
}

#[test]
fn resistances_warm_up() {
    for iron in [None, Some(IronSettings::LINEAR)] {
        let mut settings = settings();
        settings.iron = iron;
        settings.saliency = motor_plant::SaliencySettings::NONE;
        settings.warming = WarmingSettings { rs: 0.3, rr: 0.4, time_constant: 2.0 };
        let v = Complex::from(10.0);
        let factor = 1.0 + 0.3 * (1.0 - (-2.0_f64 / 2.0).exp());
        let found = held(&settings, v, 2.0);
        // The current follows the resistance within its own time constant, 40 ms of 2 s.
        near(found.current().re * 5.4 * factor / found.applied_voltage().re, 1.0, 0.005);
    }
}

/// Currents that the drive would read, A, without the errors of the converter.
fn read(plant: &mut Plant, settings: &PlantSettings) -> [f64; 2] {
    let lines = settings.measurement.calibration();
    let sample = plant.sample();
    let current = |code: u16, k: usize| f64::from(code) * lines[k].a_per_code + lines[k].a_at_zero;
    [current(sample.current_a, 0), current(sample.current_b, 1)]
}

#[test]
fn sensors_have_the_errors_they_are_given() {
    // Phase a 2.2 A, b and c half of it, back.
    let v = Complex::cis(0.3) * 12.0;
    let error = |change: &dyn Fn(&mut MeasurementSettings), seconds: f64| {
        let mut settings = settings();
        change(&mut settings.measurement);
        let mut plant = held(&settings, v, seconds);
        let [a, b, _] = plant.phase_currents();
        let [read_a, read_b] = read(&mut plant, &settings);
        (a, b, read_a - a, read_b - b)
    };
    let step = 2e-4; // a code
    let (_, _, da, db) = error(&|_| {}, 1.0);
    near(da.abs() + db.abs(), 0.0, step);
    let (a, b, da, db) = error(&|m| (m.cross_talk_a, m.cross_talk_b) = (0.02, -0.01), 1.0);
    near(da, 0.02 * b, step);
    near(db, -0.01 * a, step);
    let (a, _, da, _) = error(&|m| m.cubic_error = 0.05, 1.0);
    near(da, 0.05 * a * (a / 4.4727).powi(2), step);
    assert!(da > 0.02);
    let (_, _, da, db) = error(&|m| (m.drift_a, m.drift_b) = (0.05, -0.02), 1.0);
    near(da, 0.05, step);
    near(db, -0.02, step);
    // After 2 ms the current still rises: the reading of b is that of 40 us before.
    let slope = (error(&|_| {}, 0.0025).1 - error(&|_| {}, 0.0015).1) / 0.001;
    let (_, _, _, db) = error(&|m| m.lag_b_us = 40.0, 0.002);
    near(db, -40e-6 * slope, 0.1 * (40e-6 * slope).abs() + step);
    assert!((40e-6 * slope).abs() > 5.0 * step);
}

#[test]
fn two_conversions_a_period_have_less_noise_and_are_a_quarter_older() {
    let deviation = |both: bool| {
        let mut settings = settings();
        settings.measurement =
            MeasurementSettings { noise_a: 0.01, both_zero_vectors: both, ..settings.measurement };
        let mut plant = plant(&settings);
        let readings: Vec<f64> = (0..20_000)
            .map(|_| {
                plant.advance(&compare(Complex::ZERO), T);
                read(&mut plant, &settings)[0]
            })
            .collect();
        (readings.iter().map(|r| r * r).sum::<f64>() / readings.len() as f64).sqrt()
    };
    near(deviation(false), 0.01, 2e-4);
    near(deviation(true), 0.01 / 2.0_f64.sqrt(), 2e-4);
    // A rising current, 12 V on 51 mH: the mean is T/4 behind.
    let mut settings = settings();
    settings.measurement.both_zero_vectors = true;
    let mut plant = held(&settings, Complex::from(12.0), 0.002);
    let slope = {
        let before = plant.clone().current().re;
        let mut later = plant.clone();
        later.advance(&compare(Complex::from(12.0)), T);
        (later.current().re - before) / T
    };
    let behind = plant.current().re - read(&mut plant, &settings)[0];
    near(behind, 0.25 * T * slope, 0.05 * T * slope + 2e-4);
}

/// Voltage that the inverter loses at a constant current, and that current.
fn lost(change: impl Fn(&mut InverterSettings), volts: f64) -> (f64, f64) {
    let mut settings = settings();
    settings.inverter = InverterSettings { residual_v: 0.0, ..InverterSettings::default() };
    change(&mut settings.inverter);
    let v = Complex::from(volts);
    let plant = held(&settings, v, 1.0);
    let [a, b, c] = phases(v).map(|v| ((0.5 + v / 311.0) * 14_167.0).round() / 14_167.0 * 311.0);
    let asked = motor_plant::clarke([a, b, c]).re;
    (asked - plant.applied_voltage().re, plant.current().re)
}

#[test]
fn the_inverter_has_the_errors_it_is_given() {
    // Phase a against b and c: 4/3 of the error of a leg.
    let leg = |error: f64| 4.0 / 3.0 * error;
    let dead = 2.2e-6 * 6000.0 * 311.0;
    let (error, _) = lost(|_| {}, 15.0);
    near(error, leg(dead), 1e-6);
    let (error, _) = lost(|i| i.extra_dead_time_us = 0.5, 15.0);
    near(error, leg(dead * 2.7 / 2.2), 1e-6);
    let (error, i) = lost(|i| i.on_resistance = 0.5, 15.0);
    near(error, leg(dead) + 0.5 * i, 1e-3);
    // 20 nF take 2.8 A to swing within the dead time. Below, the error of a leg is i t^2/(2 C) of a period.
    let (error, i) = lost(|i| i.node_capacitance = 20e-9, 10.0);
    let swing = |i: f64| i * 2.2e-6 * 2.2e-6 / (2.0 * 20e-9) * 6000.0;
    assert!(i > 0.5 && i < 2.8);
    near(error, 2.0 / 3.0 * (swing(i) + swing(0.5 * i)), 1e-3);
    // Far above, the full error less C V^2/(2 i) of a period.
    let (error, i) = lost(|i| i.node_capacitance = 450e-12, 15.0);
    let full = |i: f64| dead - 450e-12 * 311.0 * 311.0 / (2.0 * i) * 6000.0;
    near(error, 2.0 / 3.0 * (full(i) + full(0.5 * i)), 1e-3);
    let switched =
        InverterSettings { switched: true, node_capacitance: 1e-9, ..InverterSettings::default() };
    let refused = PlantSettings { inverter: switched, ..settings() };
    let text = Plant::new(&refused, 1).expect_err("refused").to_string();
    assert!(text.starts_with("inverter.node_capacitance = "), "{text}");
}

#[test]
fn the_dc_link_ripples_holds_up_and_is_braked() {
    let mut settings = settings();
    settings.dc_link = DcLinkSettings { ripple: 0.1, ripple_hz: 100.0, ..Default::default() };
    let mut rippling = plant(&settings);
    let volts: Vec<f64> = (0..600)
        .map(|_| {
            rippling.advance(&compare(Complex::ZERO), T);
            rippling.dc_link()
        })
        .collect();
    near(volts.iter().fold(0.0, |a, &b| f64::max(a, b)), 342.1, 0.1);
    let crossings = volts.windows(2).filter(|w| (w[0] < 311.0) != (w[1] < 311.0)).count();
    // Two a period; the last may fall on the end.
    assert!((19..=20).contains(&crossings), "{crossings}");

    // Mains gone: the energy that the motor takes comes from the capacitor.
    settings.dc_link = DcLinkSettings { capacitor: 470e-6, outage: 1.0, ..Default::default() };
    let mut alone = plant(&settings);
    let mut taken = 0.0;
    for _ in 0..900 {
        alone.advance(&compare(Complex::from(20.0)), T);
        taken += 1.5 * (alone.current().conj() * alone.applied_voltage()).re * T;
    }
    let left = 0.5 * 470e-6 * (311.0 * 311.0 - alone.dc_link().powi(2));
    near(left / taken, 1.0, 1e-6);
    assert!(taken > 5.0 && alone.dc_link() < 290.0);

    // Six pulses of 50 Hz without load leave the peak; under load the ripple is 300 Hz.
    settings.dc_link = DcLinkSettings { capacitor: 470e-6, ..Default::default() };
    let mut fed = plant(&settings);
    for _ in 0..3000 {
        fed.advance(&compare(Complex::from(20.0)), T);
    }
    let volts: Vec<f64> = (0..600)
        .map(|_| {
            fed.advance(&compare(Complex::from(20.0)), T);
            fed.dc_link()
        })
        .collect();
    let mean = volts.iter().sum::<f64>() / 600.0;
    let rising = volts.windows(2).filter(|w| w[0] < mean && w[1] >= mean).count();
    assert_eq!(rising, 30);
    assert!(mean > 300.0 && mean < 311.0, "{mean}");

    // A chopper brings an overcharged link down to 98 % of its threshold, by R C, and leaves it.
    settings.dc_link = DcLinkSettings {
        capacitor: 470e-6,
        chopper_v: 400.0,
        chopper: 100.0,
        // The mains would be those of 420 V.
        outage: 10.0,
        ..Default::default()
    };
    let mut braked = plant(&settings);
    braked.set_dc_link(420.0).expect("in range");
    for k in 0..600 {
        braked.advance(&Compare::OFF, T);
        if k == 5 {
            near(braked.dc_link(), 420.0 * (-6.0 * T / 0.047).exp(), 0.1);
        }
    }
    near(braked.dc_link(), 391.0, 1.0);
}

#[test]
fn the_dc_link_sensor_has_gain_lag_and_noise() {
    let code = |change: &dyn Fn(&mut MeasurementSettings), periods: u32| {
        let mut settings = settings();
        change(&mut settings.measurement);
        let mut plant = plant(&settings);
        plant.advance(&Compare::OFF, T);
        plant.set_dc_link(200.0).expect("in range");
        for _ in 0..periods {
            plant.advance(&Compare::OFF, T);
        }
        f64::from(plant.sample().dc_link) * settings.measurement.dc_link_v
    };
    near(code(&|_| {}, 1), 200.0, 0.06);
    near(code(&|m| m.dc_gain_error = 0.05, 1), 210.0, 0.06);
    let lagging = 200.0 + 111.0 * (-2.0 * T / 1e-3).exp();
    near(code(&|m| m.dc_lag_us = 1000.0, 2), lagging, 0.06);
    let noisy = code(&|m| m.dc_noise_v = 5.0, 1);
    assert!((noisy - 200.0).abs() > 0.06 && (noisy - 200.0).abs() < 25.0);
}

#[test]
fn an_open_phase_has_no_current_and_the_others_have_the_same() {
    let g = FAMILIES.iter().find(|family| family.name == "g").expect("g").iron;
    for iron in [None, Some(g)] {
        for (open, switched) in [(0, false), (1, false), (2, true)] {
            let mut settings = settings();
            settings.iron = iron;
            settings.inverter = InverterSettings { switched, ..InverterSettings::default() };
            let mut plant = plant(&settings);
            let turning = |k: u32| compare(Complex::cis(TAU * 20.0 * f64::from(k) * T) * 40.0);
            for k in 0..300 {
                plant.advance(&turning(k), T);
            }
            assert!(plant.phase_currents().iter().all(|i| i.abs() > 0.01));
            plant.set_open_phase(Some(open)).expect("a phase");
            let mut largest = 0.0_f64;
            for k in 300..900 {
                plant.advance(&turning(k), T);
                let i = plant.phase_currents();
                assert!(i[open].abs() < 1e-12, "{i:?}");
                largest = largest.max(i[(open + 1) % 3].abs());
            }
            assert!(largest > 0.3, "{largest}");
            // Off, the other two die down; the open one stays without.
            for _ in 0..300 {
                plant.advance(&Compare::OFF, T);
                assert!(plant.phase_currents()[open].abs() < 1e-12);
            }
            assert_eq!(plant.current(), Complex::ZERO);
            plant.set_open_phase(None).expect("none");
            plant.advance(&turning(0), T);
            assert!(plant.current().norm() > 1e-3);
        }
    }
}

#[test]
fn refusals_name_the_setting() {
    type Case = (&'static str, fn(&mut PlantSettings));
    let cases: [Case; 10] = [
        ("warming.rr", |s| s.warming.rr = 3.0),
        ("dc_link.pulses", |s| s.dc_link.pulses = 4),
        ("dc_link.capacitor", |s| s.dc_link.capacitor = 1.0),
        ("mechanics.static_torque", |s| s.mechanics.static_torque = -1.0),
        ("mechanics.stiffness", |s| {
            (s.mechanics.load_inertia, s.mechanics.stiffness) = (0.009, 1e6);
        }),
        ("measurement.cross_talk_a", |s| s.measurement.cross_talk_a = 0.5),
        ("measurement.lag_b_us", |s| s.measurement.lag_b_us = f64::NAN),
        ("measurement.cubic_error", |s| s.measurement.cubic_error = 1.0),
        ("inverter.extra_dead_time_us", |s| s.inverter.extra_dead_time_us = -3.0),
        ("inverter.on_resistance", |s| s.inverter.on_resistance = -0.1),
    ];
    for (name, change) in cases {
        let mut settings = settings();
        change(&mut settings);
        let text = Plant::new(&settings, 1).expect_err(name).to_string();
        assert!(text.starts_with(&format!("{name} = ")) && text.contains("allowed"), "{text}");
    }
}

#[test]
fn a_load_turns_the_axis_of_the_teeth_behind_a_lag() {
    let iron = IronSettings {
        teeth: -0.035,
        teeth_gap: 0.0,
        teeth_turn_deg_per_a: 5.0,
        ..IronSettings::LINEAR
    };
    let machine = EnergyMachine::new(&MachineSettings::default(), &iron).expect("machine");
    let locked = MechanicsSettings { load: Load::Locked, ..Default::default() };
    let mut motor = MotorModel::new(machine, Mechanics::new(&locked).expect("shaft"));
    // A turning voltage: a flux, and a current across it.
    for k in 0..60_000u32 {
        motor.step(Complex::cis(TAU * 2.0 * f64::from(k) * 1e-5) * 12.0, 1e-5);
    }
    let x = motor.state.electrical;
    let across = (x.psi_r.conj() * x.current()).im / x.psi_r.norm();
    assert!(across > 0.5, "{across}");
    let (seen, set) = (motor.machine, machine.with_load(across));
    let current = |machine: &EnergyMachine| {
        let mut x = x;
        machine.settle(&mut x);
        x.current()
    };
    // The lag makes 2 % of a load that still changes; without a turn the current is another.
    let (turned, straight) = ((current(&set) - current(&machine)).norm(), current(&seen));
    assert!((straight - current(&set)).norm() < 0.1 * turned && turned > 1e-3, "{turned}");
}
