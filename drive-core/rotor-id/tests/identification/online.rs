//! Tests of rotor time constant, resistance and speed from the terminals.

use std::f64::consts::TAU;

use induction_drive_core::io::PERIOD_S;
use induction_drive_core::{AlphaBeta, Dq};
use induction_drive_rotor_id::online::{NoEstimate, Online, RotorEstimate, SpeedInput};
use induction_drive_settings::Settings;
use num_complex::Complex64;

use crate::machine::{J, Machine};

const CURRENT: Dq = Dq { d: 0.7, q: 2.0 };
/// Electrical rad/s: 150 rpm with two pole pairs.
const OMEGA_M: f64 = 31.4;
/// Control periods from one call of `refine` to the next.
const CALL: usize = 600;

fn single(x: Complex64) -> AlphaBeta {
    AlphaBeta::new(x.re as f32, x.im as f32)
}

/// A machine on an inverter, and the estimator that gets its voltage and current.
struct Bench {
    machine: Machine,
    online: Online,
    /// Voltage in the flux frame, V, and speed at which the frame rotates, rad/s.
    voltage: Complex64,
    omega: f64,
    /// Voltage on the d axis at 2 Hz, V.
    excitation: f64,
    /// Largest noise of the current, A.
    noise: f64,
    random: u32,
    /// Delay of the measured current, as a share of a period.
    delay: f64,
    n: usize,
    acting: Complex64,
    /// Commanded voltage that does not act yet.
    pending: Complex64,
}

impl Bench {
    /// Creates a machine in the steady state of [`CURRENT`].
    fn new(settings: &Settings, mut machine: Machine) -> Self {
        let (voltage, omega) = machine.settle(Complex64::new(CURRENT.d.into(), CURRENT.q.into()));
        Self {
            machine,
            online: Online::new(settings).unwrap(),
            voltage,
            omega,
            excitation: 0.0,
            noise: 0.0,
            random: 1,
            delay: f64::from(settings.scales.current_delay_s / PERIOD_S),
            n: 0,
            acting: voltage,
            pending: voltage,
        }
    }

    fn uniform(&mut self) -> f64 {
        self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.random) / f64::from(u32::MAX / 2) - 1.0
    }

    /// Runs one control period: the current is measured late, and a voltage acts a period after its command.
    fn period(&mut self) -> (AlphaBeta, AlphaBeta) {
        let period = f64::from(PERIOD_S);
        self.machine.advance(self.acting, (1.0 - self.delay) * period);
        let noise = self.noise * Complex64::new(self.uniform(), self.uniform());
        let seen = self.machine.current + noise;
        self.machine.advance(self.acting, self.delay * period);
        self.n += 1;
        let t = self.n as f64 * period;
        let moved = self.excitation * (TAU * 2.0 * t).cos();
        self.acting = self.pending;
        self.pending = (self.voltage + moved) * (J * self.omega * t).exp();
        (single(seen), single(self.pending))
    }

    /// Runs a tenth of a second, then a step of the fit.
    fn call(&mut self, speed: SpeedInput) -> Result<RotorEstimate, NoEstimate> {
        for _ in 0..CALL {
            let (measured, realised) = self.period();
            self.online.push(measured, realised);
        }
        self.online.refine(CURRENT, speed)
    }

    fn calls(&mut self, count: usize, speed: SpeedInput) -> Result<RotorEstimate, NoEstimate> {
        (0..count).map(|_| self.call(speed)).last().unwrap()
    }
}

fn known() -> SpeedInput {
    SpeedInput::Known(OMEGA_M as f32)
}

/// Returns the default settings without saliency, and their motor.
fn plain() -> (Settings, Machine) {
    let mut settings = Settings::default();
    settings.injection.synchronous.flux_saliency = 0.0;
    settings.injection.synchronous.current_saliency = Some(0.0);
    let machine = Machine::new(&settings.motor, OMEGA_M);
    (settings, machine)
}

fn near(got: f32, expected: f64, relative: f64) -> bool {
    (f64::from(got) / expected - 1.0).abs() < relative
}

#[test]
fn with_the_speed_known_rotor_and_stator_are_found() {
    for (rotor, stator) in [(1.0, 1.0), (1.3, 1.4), (0.7, 0.6)] {
        let (settings, mut machine) = plain();
        machine.rate *= rotor;
        machine.r_s *= stator;
        let mut bench = Bench::new(&settings, machine);
        let found = bench.calls(40, known()).unwrap();
        assert!(near(found.tau_r, 1.0 / machine.rate, 0.01), "{found:?}");
        assert!(near(found.resistance, machine.r_s, 0.01), "{found:?}");
        assert!(near(found.omega_m, OMEGA_M, 1e-6), "{found:?}");
    }
}

#[test]
fn with_a_flux_that_moves_the_speed_is_found_too() {
    let (settings, mut machine) = plain();
    machine.rate *= 1.2;
    for guess in [OMEGA_M - 2.0, OMEGA_M + 2.0] {
        let mut bench = Bench::new(&settings, machine);
        let still = bench.calls(40, SpeedInput::Guess(guess as f32));
        assert_eq!(still, Err(NoEstimate::PoorExcitation), "speed and slip look the same");
        bench.excitation = 1.2;
        let found = bench.calls(60, SpeedInput::Guess(guess as f32)).unwrap();
        assert!(near(found.tau_r, 1.0 / machine.rate, 0.01), "{found:?}");
        assert!(near(found.omega_m, OMEGA_M, 0.003), "{found:?}");
    }
}

/// The axis of the saliency rotates with the current: sigma L_s (1 + share) along the current.
#[test]
fn the_saliency_is_taken_into_account() {
    let (mut settings, mut machine) = plain();
    let synchronous = &mut settings.injection.synchronous;
    (synchronous.flux_saliency, synchronous.current_saliency) = (0.1, Some(0.05));
    let (d, q) = (f64::from(CURRENT.d), f64::from(CURRENT.q));
    let square = d * d + q * q;
    machine.sigma_l_s *= 1.0 + 0.05 * square.sqrt() + 0.1 * (d * d - q * q) / square;
    let found = Bench::new(&settings, machine).calls(40, known()).unwrap();
    assert!(near(found.tau_r, 1.0 / machine.rate, 0.01), "{found:?}");
}

#[test]
fn it_speaks_after_three_seconds_and_again_three_seconds_after_a_transient() {
    let (settings, machine) = plain();
    let mut bench = Bench::new(&settings, machine);
    for _ in 0..2 {
        assert_eq!(bench.calls(29, known()), Err(NoEstimate::Settling));
        bench.call(known()).unwrap();
        // 3 rad/s count as another machine.
        assert!(bench.call(SpeedInput::Known((OMEGA_M + 2.9) as f32)).is_ok());
        bench.calls(60, known()).unwrap();
        assert_eq!(
            bench.call(SpeedInput::Known((OMEGA_M - 3.4) as f32)),
            Err(NoEstimate::Transient)
        );
        bench.online = Online::new(&settings).unwrap();
    }
    // A change of 0.175 A, a quarter of the magnetising current, also counts as another machine, in either axis.
    for (step, steady) in [(0.17, true), (0.2, false)] {
        for axis in [Dq::new(1.0, 0.0), Dq::new(0.0, -1.0)] {
            let mut bench = Bench::new(&settings, machine);
            bench.calls(40, known()).unwrap();
            let (measured, realised) = bench.period();
            bench.online.push(measured, realised);
            let other = bench.online.refine(CURRENT + axis * step, known());
            assert_eq!(other.is_ok(), steady, "{step} {axis:?}");
            assert_eq!(other.err(), (!steady).then_some(NoEstimate::Transient));
            assert_eq!(bench.calls(29, known()).is_ok(), steady, "forgotten after a step");
            bench.call(known()).unwrap();
        }
    }
}

#[test]
fn poor_excitation_and_lost_samples_give_no_estimate() {
    let (settings, machine) = plain();
    // Without torque there is no current in the rotor.
    let mut bench = Bench::new(&settings, machine);
    (bench.voltage, bench.omega) = bench.machine.settle(Complex64::new(0.7, 0.0));
    for _ in 0..60 {
        assert!(bench.call(known()).is_err());
    }
    // More than 75 samples of 8 periods are not used, because of a voltage beyond the largest dc link.
    for (lost, enough) in [(560, true), (610, false)] {
        let mut bench = Bench::new(&settings, machine);
        bench.calls(40, known()).unwrap();
        for _ in 0..lost {
            let (measured, realised) = bench.period();
            bench.online.push(measured, realised * 1e6);
        }
        let found = bench.online.refine(CURRENT, known());
        assert_eq!(found.err(), (!enough).then_some(NoEstimate::PoorExcitation), "{lost}");
    }
    // A value that is not a number restarts the estimation.
    for (bad, none) in [(AlphaBeta::new(f32::NAN, 0.0), AlphaBeta::ZERO)]
        .into_iter()
        .flat_map(|(a, b)| [(a, b), (b, a)])
    {
        let mut bench = Bench::new(&settings, machine);
        bench.calls(40, known()).unwrap();
        bench.online.push(bad, none);
        assert_eq!(bench.calls(29, known()), Err(NoEstimate::Settling));
        bench.call(known()).unwrap();
    }
    for (current, speed) in
        [(CURRENT, SpeedInput::Known(f32::NAN)), (Dq::new(f32::INFINITY, 0.0), known())]
    {
        let mut bench = Bench::new(&settings, machine);
        bench.calls(40, known()).unwrap();
        assert_eq!(bench.online.refine(current, speed), Err(NoEstimate::Transient));
        assert_eq!(bench.calls(29, known()), Err(NoEstimate::Settling));
        bench.call(known()).unwrap();
    }
}

#[test]
fn estimates_out_of_range_are_refused() {
    let unbelievable = Some(NoEstimate::OutOfRange);
    for (rotor, stator, doubt) in [
        (1.0 / 1.85, 1.0, None),
        (1.0 / 2.2, 1.0, unbelievable),
        (1.9, 1.0, None),
        (2.15, 1.0, unbelievable),
        (1.0, 2.9, None),
        (1.0, 3.15, unbelievable),
    ] {
        let (settings, mut machine) = plain();
        machine.rate *= rotor;
        machine.r_s *= stator;
        machine.omega_m = 12.6;
        let mut bench = Bench::new(&settings, machine);
        let seen: Vec<_> = (0..130).map(|_| bench.call(SpeedInput::Known(12.6)).err()).collect();
        assert!(seen.contains(&doubt), "{rotor} {stator}");
        // (On its way to a resistance out of range, the fit passes through valid ones.)
        assert!(doubt.is_none() || rotor == 1.0 || !seen.contains(&None), "{rotor} {stator}");
    }
}

/// The noise of the current scatters the estimates by about their own uncertainty.
#[test]
fn the_uncertainty_is_that_of_the_noise() {
    let (settings, machine) = plain();
    let estimates: Vec<RotorEstimate> = (1..=12)
        .map(|seed| {
            let mut bench = Bench::new(&settings, machine);
            (bench.noise, bench.random) = (0.1, seed * 12_345);
            bench.calls(40, known()).unwrap()
        })
        .collect();
    let mean = |value: &dyn Fn(&RotorEstimate) -> f64| {
        estimates.iter().map(value).sum::<f64>() / estimates.len() as f64
    };
    let tau_r = mean(&|e| e.tau_r.into());
    let scatter = mean(&|e| (f64::from(e.tau_r) / tau_r - 1.0).powi(2)).sqrt();
    let said = mean(&|e| e.uncertainty.into());
    assert!(said > 0.5 * scatter && said < 3.0 * scatter, "{scatter} {said}");
}

/// The bases lie between a fiftieth of the limits and the limits, for any motor.
#[test]
fn the_bases_are_of_the_size_of_voltage_and_current() {
    let bases = |r_s: f32, i_d: f32| {
        let (mut settings, _) = plain();
        (settings.motor.r_s, settings.sequence.i_d) = (r_s, Some(i_d));
        let used = *Online::new(&settings).unwrap().rls().settings();
        assert_eq!(used.voltage_limit, settings.dc_over_v());
        assert_eq!(used.current_limit, settings.trip_a());
        (used.voltage_base / settings.dc_over_v(), used.current_base)
    };
    let settings = Settings::default();
    assert_eq!(bases(5.4, 0.7), (5.4 * settings.current_limit_a() / settings.dc_over_v(), 0.7));
    assert_eq!(bases(0.01, 0.01), (0.02, 0.02 * settings.trip_a()));
    assert_eq!(bases(900.0, 3.5), (1.0, 3.5));
}
