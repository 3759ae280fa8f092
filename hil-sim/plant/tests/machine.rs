//! Checks of the machine model against the exact solution of the textbook machine, and of its power balance.

use motor_plant::{
    Complex, Load, Machine, MachineModel, MachineSettings, MachineState, Mechanics,
    MechanicsSettings, MotorModel, SaliencySettings,
};
use nalgebra::{Matrix4, Matrix4x2, SMatrix, Vector2, Vector4};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

const PERIOD: f64 = 1.0 / 6000.0;
const M: MachineSettings =
    MachineSettings { rs: 5.4, rr: 1.1, lls: 0.0276, llr: 0.0276, lm: 0.1771, pole_pairs: 2 };
const LS: f64 = 0.0276 + 0.1771;

fn motor(saliency: &SaliencySettings, mechanics: &MechanicsSettings) -> MotorModel {
    MotorModel::new(
        Machine::new(&M, saliency).expect("machine"),
        Mechanics::new(mechanics).expect("shaft"),
    )
}

/// Rotor current, A, referred to the stator: `(psi - Lm i)/Lr`.
fn rotor_current(x: &MachineState) -> Complex {
    (x.psi - x.i * M.lm) / LS
}

/// Eq. 2.9 in stator and rotor currents, all in the stator frame, as real matrices. Returns the exact step over `h`
/// seconds at constant voltage, by the matrix exponential.
fn exact_step(w: f64, h: f64) -> (Matrix4<f64>, Matrix4x2<f64>) {
    let (l, lm) = (LS, M.lm);
    #[rustfmt::skip]
    let inductance = Matrix4::new(
        l,   0.0, lm,  0.0,
        0.0, l,   0.0, lm,
        lm,  0.0, l,   0.0,
        0.0, lm,  0.0, l,
    );
    // The rotor voltage is 0 = rr ir + dpsi/dt - j w psi; times j is (x, y) -> (-y, x).
    #[rustfmt::skip]
    let rest = Matrix4::new(
        -M.rs,  0.0,     0.0,    0.0,
        0.0,    -M.rs,   0.0,    0.0,
        0.0,    -w * lm, -M.rr,  -w * l,
        w * lm, 0.0,     w * l,  -M.rr,
    );
    let inverse = inductance.try_inverse().expect("regular");
    let a = inverse * rest;
    let b = inverse * Matrix4x2::identity();
    let mut augmented = SMatrix::<f64, 6, 6>::zeros();
    augmented.fixed_view_mut::<4, 4>(0, 0).copy_from(&(a * h));
    augmented.fixed_view_mut::<4, 2>(0, 4).copy_from(&(b * h));
    // The series of the exponential is summed here, because nalgebra's own needs a feature that compiles SIMD types.
    let (mut exp, mut term) = (SMatrix::<f64, 6, 6>::identity(), SMatrix::<f64, 6, 6>::identity());
    for n in 1..=20 {
        term = term * augmented / f64::from(n);
        exp += term;
    }
    (exp.fixed_view::<4, 4>(0, 0).into(), exp.fixed_view::<4, 2>(0, 4).into())
}

/// Largest error of current and flux relative to their largest magnitudes, over one second of voltages that change at
/// random every period.
fn worst_error(rpm: f64, substeps: u32) -> f64 {
    let speed = rpm * std::f64::consts::TAU / 60.0;
    let shaft = MechanicsSettings { load: Load::Speed { speed }, ..Default::default() };
    let mut motor = motor(&SaliencySettings::NONE, &shaft);
    let (phi, gamma) = exact_step(2.0 * speed, PERIOD);
    let mut exact = Vector4::zeros();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
    let (mut i_error, mut psi_error, mut i_max, mut psi_max) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for k in 0..6000 {
        // A rotating voltage, which builds up flux, and a random voltage.
        let rotating = Complex::from_polar(60.0, 130.0 * f64::from(k) * PERIOD);
        let random = Complex::new(rng.random_range(-50.0..50.0), rng.random_range(-50.0..50.0));
        let v = rotating + random;
        exact = phi * exact + gamma * Vector2::new(v.re, v.im);
        for _ in 0..substeps {
            motor.step(v, PERIOD / f64::from(substeps));
        }
        let (i, psi) = (motor.state.electrical.i, motor.state.electrical.psi);
        let exact_i = Complex::new(exact[0], exact[1]);
        let exact_psi = exact_i * M.lm + Complex::new(exact[2], exact[3]) * LS;
        i_error = i_error.max((i - exact_i).norm());
        psi_error = psi_error.max((psi - exact_psi).norm());
        i_max = i_max.max(exact_i.norm());
        psi_max = psi_max.max(exact_psi.norm());
    }
    (i_error / i_max).max(psi_error / psi_max)
}

#[test]
fn agrees_with_the_matrix_exponential() {
    for rpm in [0.0, 30.0, -150.0, 1440.0] {
        // Fourth order: the error falls as h^4 until rounding, about 1e-13, dominates. At 1440 rpm (302 rad/s
        // electrical) a step of T/16 has an error of (w h)^5/120 = 2.6e-15. The flux accumulates it over its time
        // constant of 186 ms, or 18 000 steps: 5e-11.
        let fine = worst_error(rpm, 16);
        assert!(fine < 1e-10, "{rpm} rpm, 16 substeps: {fine:e}");
        // With the default of two substeps the error is 8^4 = 4096 times as large.
        let coarse = worst_error(rpm, 2);
        assert!(coarse < 5e-8, "{rpm} rpm, 2 substeps: {coarse:e}");
    }
}

fn random_state(rng: &mut Xoshiro256PlusPlus) -> (MachineState, Complex, f64) {
    let mut vector = |length: f64| {
        Complex::new(rng.random_range(-length..length), rng.random_range(-length..length))
    };
    let x = MachineState { i: vector(4.0), psi: vector(0.5), i_lp: vector(4.0) };
    (x, vector(180.0), rng.random_range(-400.0..400.0))
}

#[test]
fn without_saliency_the_derivative_is_that_of_the_textbook() {
    let machine = Machine::new(&M, &SaliencySettings::NONE).expect("machine");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
    let j = Complex::new(0.0, 1.0);
    for _ in 0..1000 {
        let (x, v, w) = random_state(&mut rng);
        let rate = machine.derivative(&x, v, w);
        // Back through Eq. 2.9: flux linkages and rotor current from the state and its derivative.
        let (i_r, rate_r) = (rotor_current(&x), (rate.psi - rate.i * M.lm) / LS);
        let stator = x.i * M.rs + rate.i * LS + rate_r * M.lm;
        let rotor = i_r * M.rr + rate.psi - j * w * x.psi;
        assert!((stator - v).norm() < 1e-10, "stator equation: {stator} for {v}");
        assert!(rotor.norm() < 1e-10, "rotor equation: {rotor}");
        // The saliency is exactly zero, not a small number.
        assert_eq!(machine.saliency(&x), Complex::ZERO);
    }
}

#[test]
fn power_balances_at_every_instant() {
    let machine = Machine::new(&M, &SaliencySettings::NONE).expect("machine");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
    let real = |a: Complex, b: Complex| 1.5 * (a.conj() * b).re;
    for _ in 0..1000 {
        let (x, v, w) = random_state(&mut rng);
        let rate = machine.derivative(&x, v, w);
        let i_r = rotor_current(&x);
        let rate_r = (rate.psi - rate.i * M.lm) / LS;
        let stator_flux_rate = rate.i * LS + rate_r * M.lm;
        let input = real(x.i, v);
        let losses = M.rs * real(x.i, x.i) + M.rr * real(i_r, i_r);
        // The inductance matrix is symmetric, therefore dW/dt = i . d(L i)/dt.
        let stored = real(x.i, stator_flux_rate) + real(i_r, rate.psi);
        let mechanical = machine.torque(&x) * w / 2.0;
        let error = input - losses - stored - mechanical;
        let scale = input.abs() + losses + stored.abs() + mechanical.abs();
        assert!(error.abs() < 1e-12 * scale, "{error} of {scale} W");
    }
}

#[test]
fn energy_balances_over_a_start() {
    let shaft = MechanicsSettings { friction: 0.0, ..Default::default() };
    let mut motor = motor(&SaliencySettings::NONE, &shaft);
    let power = |motor: &MotorModel, v: Complex| {
        let x = &motor.state.electrical;
        let (i, i_r) = (x.i, rotor_current(x));
        1.5 * ((i.conj() * v).re - M.rs * i.norm_sqr() - M.rr * i_r.norm_sqr())
    };
    let h = PERIOD / 50.0;
    let mut delivered = 0.0;
    for k in 0..1200 {
        let v = Complex::from_polar(100.0, std::f64::consts::TAU * 20.0 * f64::from(k) * PERIOD);
        for _ in 0..50 {
            let before = power(&motor, v);
            motor.step(v, h);
            delivered += 0.5 * h * (before + power(&motor, v));
        }
    }
    let x = &motor.state.electrical;
    let i_r = rotor_current(x);
    let stator_flux = x.i * LS + i_r * M.lm;
    let stored = 0.75 * ((x.i.conj() * stator_flux).re + (i_r.conj() * x.psi).re);
    let kinetic = 0.5 * shaft.inertia * motor.state.speed.powi(2);
    let error = (delivered - stored - kinetic) / kinetic;
    // The error of the trapezoidal rule is (300 rad/s * 3.3 us)^2/12 = 8e-8 of the power, which is several times the
    // power that becomes kinetic.
    assert!(motor.state.speed > 30.0 && error.abs() < 1e-6, "{error:e}");
}
