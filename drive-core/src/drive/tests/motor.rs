//! Tests of the drive on a salient motor with ideal sensors and an ideal inverter, in `f64`.
#![allow(clippy::disallowed_methods)] // std functions are the reference here

use num_complex::Complex64;

#[cfg(all(feature = "flying-start", feature = "position", feature = "vf"))]
mod allowed;
mod stops;

use super::*;
use crate::identify::learning::Verdict;
use crate::io::PERIOD_S;

const J: Complex64 = Complex64::I;

/// The motor of the settings, with the saliency of the settings: L x = sigma L_s (x - s x*) with s = a
/// e^(2j phi) + b i²/|i|.
#[derive(Clone)]
struct Motor {
    settings: Settings,
    current: Complex64,
    /// Flux (L_m / L_r) psi_r, V s.
    flux: Complex64,
    /// Electrical angle of the rotor, rad, and its speed, rad/s.
    theta: f64,
    omega: f64,
    /// Torque of the load, Nm; none if the shaft is locked.
    load: Option<f64>,
    flux_saliency: f64,
    /// Gain of current sensor a.
    gain_a: f64,
    /// Voltage error of each leg by the dead time, V.
    dead_v: f64,
    pending: Compare,
}

const V_DC: f64 = 311.0;

impl Motor {
    fn new(settings: &Settings) -> Self {
        Self {
            settings: *settings,
            current: Complex64::ZERO,
            flux: Complex64::ZERO,
            theta: 0.0,
            omega: 0.0,
            load: Some(0.0),
            flux_saliency: settings.injection.synchronous.flux_saliency.into(),
            gain_a: 1.0,
            dead_v: 0.0,
            pending: Compare::OFF,
        }
    }

    fn sample(&self) -> Sample {
        let b = self.current.re * -0.5 + self.current.im * 0.75_f64.sqrt();
        let code = |line: Line, i: f64| ((i as f32 - line.offset) / line.gain).round() as u16;
        let count = self.theta / core::f64::consts::TAU * 5000.0;
        Sample {
            heat_sink: 1309,
            current_a: code(Line::CHANNEL_A, self.gain_a * self.current.re),
            current_b: code(Line::CHANNEL_B, b),
            dc_link: (V_DC / 0.11).round() as u16,
            encoder: count.floor() as i64 as u32,
            ..Sample::default()
        }
    }

    /// Runs a period with the compare values of the period before.
    fn advance(&mut self, compare: Compare) {
        let p = core::mem::replace(&mut self.pending, compare);
        let [a, b, c] = [p.a, p.b, p.c].map(|c| f64::from(c) / 14_167.0 * V_DC);
        let vector = |a: f64, b: f64, c: f64| {
            Complex64::new((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
        };
        if !p.enabled {
            self.current = Complex64::ZERO;
            return;
        }
        let m = self.settings.motor;
        let (rate, coupled) = (1.0 / f64::from(m.tau_r()), f64::from(m.coupled_inductance()));
        let pairs = f64::from(m.pole_pairs);
        let h = f64::from(PERIOD_S) / 8.0;
        for _ in 0..8 {
            let (i, flux) = (self.current, self.flux);
            let d_flux = coupled * rate * i - (rate - J * self.omega) * flux;
            let (half, root) = (-0.5 * i.re, 0.75_f64.sqrt() * i.im);
            let lost = [i.re, half + root, half - root].map(|i| self.dead_v * i.signum());
            let v = vector(a - lost[0], b - lost[1], c - lost[2]);
            let e = v - f64::from(m.r_s) * i - d_flux;
            let turned = |x: Complex64| x * x / x.norm_sqr().max(1e-12);
            let s = self.flux_saliency * turned(flux)
                + f64::from(self.settings.current_saliency()) * i.norm() * turned(i);
            let di = (e + s * e.conj()) / (f64::from(m.sigma_l_s()) * (1.0 - s.norm_sqr()));
            self.current += di * h;
            self.flux += d_flux * h;
            if let Some(load) = self.load {
                let torque = 1.5 * pairs * (flux.conj() * i).im;
                self.omega += pairs * (torque - load) / f64::from(self.settings.inertia()) * h;
                self.theta += self.omega * h;
            }
        }
    }

    fn turns(&self) -> f64 {
        self.theta / 2.0 / core::f64::consts::TAU
    }

    fn rpm(&self) -> f64 {
        self.omega / 2.0 / core::f64::consts::TAU * 60.0
    }
}

/// Returns settings for this motor: no dead time, no delay of the sensors.
fn motor_settings(source: AngleSource) -> Settings {
    let mut settings = settings();
    settings.angle_source = source;
    settings.inertia = Some(0.012);
    settings.scales.current_delay_s = 0.0;
    settings
}

#[derive(Clone)]
struct Bench {
    drive: Drive,
    motor: Motor,
    front_end: FrontEndState,
}

impl Bench {
    fn new(settings: &Settings) -> Self {
        let drive = Drive::new(settings.build().unwrap());
        Self { drive, motor: Motor::new(settings), front_end: FrontEndState::default() }
    }

    fn started(settings: &Settings, mode: Mode) -> Self {
        let mut bench = Self::new(settings);
        bench.drive.command(&Command::Start(mode)).unwrap();
        assert!(bench.run_to(State::of_mode(mode)), "{}", bench.drive.state());
        bench
    }

    fn step(&mut self) {
        let sample = self.motor.sample();
        let compare = step(&mut self.drive, &mut self.front_end, &sample);
        self.motor.advance(compare);
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds * 6000.0) as u32 {
            self.step();
        }
    }

    fn run_to(&mut self, state: State) -> bool {
        (0..18_000).any(|_| {
            self.step();
            self.drive.state() == state
        })
    }

    /// Returns the error of the estimated flux angle, degrees.
    fn angle_error(&self) -> f64 {
        let phi = f64::from(self.drive.telemetry().phi.to_radians());
        // The telemetry belongs to the sample; the motor is one period ahead.
        let slip = self.drive.telemetry().flux_freq;
        let now = phi + f64::from(slip) * core::f64::consts::TAU;
        (self.motor.flux * (-J * now).exp()).arg().to_degrees()
    }

    /// Runs for `seconds` and returns the largest error of the angle, degrees.
    fn worst(&mut self, seconds: f64) -> f64 {
        (0..(seconds * 6000.0) as u32)
            .map(|_| {
                self.step();
                self.angle_error().abs()
            })
            .fold(0.0, f64::max)
    }
}

#[cfg_attr(not(feature = "position"), ignore)]
#[test]
fn without_a_sensor_speed_and_position_are_those_of_the_rotor() {
    let mut bench = Bench::started(&motor_settings(AngleSource::Injection), Mode::Speed);
    for (rpm, load) in [(300.0, 0.5), (-300.0, 0.5), (150.0, -0.5)] {
        bench.motor.load = Some(load);
        bench.drive.command(&Command::Speed(rpm)).unwrap();
        let worst = bench.worst(4.0);
        assert!(worst < 15.0, "{rpm} rpm: {worst} degrees on the way");
        let settled = bench.worst(0.2);
        assert!(settled < 4.0, "{rpm} rpm: {settled} degrees");
        // An angle error of a degree changes the flux, and therefore the slip: 2 rpm per degree.
        assert!((bench.motor.rpm() - f64::from(rpm)).abs() < 12.0, "{}", bench.motor.rpm());
        let t = bench.drive.telemetry();
        let seen = f64::from(t.rotor_freq) * 6000.0 / 2.0 * 60.0;
        assert!((seen - bench.motor.rpm()).abs() < 20.0, "{seen}");
        assert!((f64::from(t.turns) - bench.motor.turns()).abs() < 0.7, "{}", t.turns);
    }
    bench.drive.command(&Command::Stop(Stop::Coast)).unwrap();
    bench.motor.load = Some(0.0);
    assert!(bench.run_to(State::Off));
    let mut bench = Bench::started(&motor_settings(AngleSource::Injection), Mode::Position);
    bench.drive.command(&Command::Position(-2.0)).unwrap();
    bench.run(3.0);
    assert!((bench.motor.turns() + 2.0).abs() < 0.02, "{}", bench.motor.turns());
    let most = bench.drive.c.protection.i_q;
    for a in [-0.1, most * 1.01, f32::NAN] {
        let refused = bench.drive.command(&Command::Press(60.0, a));
        assert_eq!(refused, Err(Refused::OutOfRange { min: 0.0, max: most }));
    }
    assert!(bench.drive.command(&Command::Home(1001.0)).is_err());
    assert!(bench.drive.command(&Command::Home(f32::NAN)).is_err());
    bench.run(0.5);
    assert!((bench.motor.turns() + 2.0).abs() < 0.02, "refused commands change nothing");
    // The shaft turns at that speed until a position is given.
    bench.drive.command(&Command::Press(60.0, 1.0)).unwrap();
    bench.run(2.0);
    assert!((bench.motor.rpm() - 60.0).abs() < 12.0, "{}", bench.motor.rpm());
    // The shaft goes one turn beyond the former position 0.
    bench.drive.command(&Command::Home(1.0)).unwrap();
    bench.run(3.0);
    assert!((bench.motor.turns() - 1.0).abs() < 0.03, "{}", bench.motor.turns());
}

#[test]
fn with_the_encoder_the_flux_is_known_and_the_torque_is_what_was_asked() {
    let mut settings = motor_settings(AngleSource::Encoder);
    settings.track_rotor = true;
    let mut bench = Bench::new(&settings);
    assert!(!bench.drive.tracks_rotor());
    bench.drive.command(&Command::Start(Mode::Torque)).unwrap();
    assert!(bench.run_to(State::Magnetising) && !bench.drive.tracks_rotor());
    assert!(bench.run_to(State::Torque) && bench.drive.tracks_rotor());
    for i_q in [2.0, -2.0] {
        bench.drive.command(&Command::Torque(i_q)).unwrap();
        let before = bench.motor.omega;
        let worst = bench.worst(0.5);
        assert!(worst < 2.0, "{i_q} A: {worst} degrees");
        // The torque 3/2 P L_m^2 / L_r i_d i_q accelerates the inertia; the current takes about 10 ms.
        let torque = 0.459_664 * 0.7 * f64::from(i_q);
        let gained = (bench.motor.omega - before) / (2.0 * torque / 0.012 * 0.5);
        assert!((gained - 1.0).abs() < 0.03, "{gained}");
    }
    settings.track_rotor = false;
    assert!(!Bench::started(&settings, Mode::Torque).drive.tracks_rotor());
}

/// The ramp is 30 A/s for either sign of the torque.
#[test]
fn a_stop_takes_the_torque_away_by_its_ramp() {
    for i_q in [1.5, -1.5] {
        let mut bench = Bench::started(&motor_settings(AngleSource::Encoder), Mode::Torque);
        bench.drive.command(&Command::Torque(i_q)).unwrap();
        bench.run(0.1);
        bench.drive.command(&Command::Stop(Stop::Coast)).unwrap();
        bench.run(0.025);
        assert_eq!(bench.drive.state(), State::Stopping);
        let reference = bench.drive.telemetry().reference.q;
        assert!((reference - i_q * 0.5).abs() < 0.15, "{i_q}: {reference}");
        bench.run(0.026);
        assert_eq!(bench.drive.state(), State::Off);
    }
}

#[test]
fn a_motor_without_saliency_does_not_start_and_one_that_loses_it_stops() {
    let settings = motor_settings(AngleSource::Injection);
    let mut bench = Bench::new(&settings);
    bench.motor.flux_saliency = 0.0;
    bench.drive.command(&Command::Start(Mode::Torque)).unwrap();
    assert!(bench.run_to(State::Fault(Fault::NoSaliency)), "{}", bench.drive.state());
    let mut bench = Bench::started(&settings, Mode::Torque);
    bench.run(1.0);
    assert_eq!(bench.drive.state(), State::Torque);
    assert!(bench.drive.telemetry().saliency_loss.abs() < 0.2);
    bench.motor.flux_saliency = 0.0;
    assert!(bench.run_to(State::Fault(Fault::LostLock)), "{}", bench.drive.state());
}

#[test]
fn without_a_sensor_it_trips_beyond_the_speed_that_is_tracked() {
    // The injection alone gives the angle.
    let mut settings = motor_settings(AngleSource::Injection);
    settings.observer.enabled = false;
    let mut bench = Bench::started(&settings, Mode::Torque);
    bench.drive.command(&Command::Torque(1.0)).unwrap();
    assert!(bench.run_to(State::Fault(Fault::OverSpeed)), "{}", bench.drive.state());
    assert!((bench.motor.rpm() - 700.0).abs() < 15.0, "{}", bench.motor.rpm());
}

/// A frame that rotates several hertz faster or slower than the rotor has no flux. The whole back-EMF is missing, so the drive searches again
/// before it regulates. A frame that is off by one hertz is pulled in.
#[cfg_attr(not(feature = "flying-start"), ignore)]
#[test]
fn a_shaft_whose_speed_was_found_wrongly_is_searched_again() {
    let mut settings = motor_settings(AngleSource::Injection);
    (settings.observer.enabled, settings.sequence.flying_start) = (true, true);
    for (rpm, wrong_by) in [
        (180.0, 0.0),
        (180.0, 1.0),
        (-180.0, 1.0),
        (180.0, 8.0),
        (-180.0, -8.0),
        (-180.0, 8.0),
        (300.0, -7.0),
        (300.0, -13.0),
        (300.0, -30.0),
        (300.0, 40.0),
    ] {
        let mut bench = Bench::new(&settings);
        bench.motor.omega = rpm / 60.0 * 2.0 * core::f64::consts::TAU;
        bench.drive.command(&Command::Start(Mode::Torque)).unwrap();
        let mut builds = false;
        while matches!(
            bench.drive.state(),
            State::Calibrating | State::Precharge | State::FlyingStart
        ) {
            bench.step();
            if let Phase::Field(field) = &mut bench.drive.phase {
                let now = matches!(field.flux, FluxPhase::Build { .. });
                if now && !builds {
                    let freq = field.estimator.axis.rotor_freq;
                    field.estimator.preset_speed(freq + wrong_by * PERIOD_S);
                }
                builds = now;
            }
        }
        // The flux settles after it has been pulled in.
        bench.run(0.3);
        let state = bench.drive.state();
        let is_right = state == State::Torque && bench.worst(0.1) < 6.0;
        assert!(is_right, "{rpm} rpm, wrong by {wrong_by} Hz: {state}");
    }
}

/// With the shaft locked, the self-commissioning finds the parameters of the simulated motor.
#[test]
fn learning_finds_the_saliencies_and_the_mismatch() {
    let mut settings = motor_settings(AngleSource::Injection);
    settings.injection.synchronous.allow_unlearned = false;
    let mut bench = Bench::new(&settings);
    let refused = bench.drive.command(&Command::Start(Mode::Torque));
    assert_eq!(refused, Err(Refused::NotLearned));
    bench.motor.load = None;
    bench.motor.gain_a = 1.02;
    let changes = bench.drive.changes;
    bench.drive.command(&Command::Start(Mode::Learning)).unwrap();
    assert!((0..2_000_000).any(|_| {
        bench.step();
        bench.drive.state() == State::Off
    }));
    assert_eq!(bench.drive.changes, changes + 1);
    let learned = *bench.drive.learned().unwrap();
    assert!(learned.verdict == Verdict::Sound && learned.points == 13, "{learned:?}");
    // The sensitivity is twice the saliency fixed to the flux, plus the effect of the smaller flux behind and the larger flux
    // ahead.
    assert!((learned.slope_at_rest / -0.07 - 1.0).abs() < 0.12, "{learned:?}");
    assert!((learned.gain_mismatch.value - 0.02).abs() < 0.002, "{learned:?}");
    assert!((learned.current_saliency.value / 0.0338 - 1.0).abs() < 0.12, "{learned:?}");
    // The saliency of this motor does not fall with the flux, as the check assumes: 0.866 of it is measured, not 0.540.
    let seen = -0.035 * 0.866 / 0.540;
    assert!((learned.flux_saliency / seen - 1.0).abs() < 0.1, "{learned:?}");
    for i_q in [0.5_f32, 1.0, 2.0, -3.0] {
        // The expected value is 2 b i_d i_q / |i|.
        let expected = 2.0 * 0.0338 * 0.7 * i_q / i_q.hypot(0.7);
        let found = learned.reference.at(i_q);
        assert!((found / expected - 1.0).abs() < 0.2, "{i_q} A: {found} {expected}");
    }
    // The result is valid until the next self-commissioning, which the free shaft ends.
    bench.drive.command(&Command::Start(Mode::Torque)).unwrap();
    assert_eq!(bench.drive.learned(), Some(&learned));
    bench.drive.command(&Command::Stop(Stop::Coast)).unwrap();
    bench.motor.load = Some(0.0);
    bench.drive.command(&Command::Start(Mode::Learning)).unwrap();
    assert_eq!(bench.drive.learned(), None);
    assert!((0..600_000).any(|_| {
        bench.step();
        bench.drive.state() == State::Fault(Fault::ShaftNotLocked)
    }));
}

/// The injection changes the signs of the phase currents within its period. The dead time is compensated as
/// the signs change, and the regulated current does not contain the rest of the injection current after the
/// filter.
#[test]
fn the_carrier_is_what_was_asked_for_and_stays_out_of_the_current_loop() {
    let mut settings = motor_settings(AngleSource::Encoder);
    settings.injection.beside_encoder = true;
    settings.sequence.magnetise_s = Some(0.8);
    let mut carriers = [0.0; 2];
    for (carrier, dead_v) in carriers.iter_mut().zip([0.0, 2.2e-6 * 6000.0 * V_DC]) {
        settings.inverter.compensate = dead_v > 0.0;
        let mut bench = Bench::new(&settings);
        bench.motor.dead_v = dead_v;
        bench.drive.command(&Command::Start(Mode::Speed)).unwrap();
        assert!(bench.run_to(State::Speed));
        bench.drive.command(&Command::Speed(300.0)).unwrap();
        bench.run(2.0);
        let (mut ripple, mut sum) = (vec![], 0.0);
        for _ in 0..600 {
            bench.step();
            let t = bench.drive.telemetry();
            ripple.push((t.current.q - t.reference.q).abs());
            sum += t.carrier_squared.sqrt();
        }
        // The median is used, because now and then an encoder count more or less moves the speed loop, and the current
        // then lags behind the direct share of the reference by 80 mA for a moment.
        ripple.sort_by(f32::total_cmp);
        let most = if dead_v > 0.0 { 0.006 } else { 0.002 };
        assert!(ripple[300] < most, "{dead_v} V: {} A", ripple[300]);
        *carrier = sum / 600.0;
    }
    assert!((carriers[1] / carriers[0] - 1.0).abs() < 0.01, "{carriers:?}");
}
