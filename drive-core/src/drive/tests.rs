//! Tests of the drive on a resistive-inductive load: sequence, protections, commands. The simulator
//! tests it with a motor.

mod motor;
mod protections;
mod ranges;
mod standstill_test;
#[cfg(feature = "flying-start")]
mod trust;

use super::*;
use crate::filter::dissertation::LPF;
use crate::flux::AngleSource;
use crate::math::frames::{Abc, AlphaBeta};

use crate::carrier::CARRIER_SAMPLES;
use crate::front_end::FrontEndState;
use crate::io::{Compare, Hardware, Sample};
use crate::line::Line;
use crate::math::angle::{Angle, UnitVector};
use crate::printed::{DemodulatorKind, PrintedState};
use crate::settings::{IdentifiedPlant, Settings};
use proptest::prelude::*;

const MODES: [Mode; 6] = [
    Mode::Torque,
    Mode::Speed,
    Mode::Position,
    Mode::VoltsPerHertz,
    Mode::Learning,
    Mode::Commissioning,
];

/// Runs a whole period of a drive with its front end.
fn step(drive: &mut Drive, front_end: &mut FrontEndState, sample: &Sample) -> Compare {
    drive.period(front_end, sample, &mut |_| {}).0
}

/// Three windings of 6.2 ohm and 51.5 mH, which represent the motor for the current loop.
struct Load {
    current: AlphaBeta,
    pending: Compare,
    v_dc: f32,
    /// The only direction in which a current can flow when a phase is open.
    only: Option<UnitVector>,
    front_end: FrontEndState,
    /// Random number of this period. Without noise, the steps of the ADC cause a regular oscillation, which a start mistakes for
    /// a rotating rotor.
    random: u32,
}

impl Load {
    fn new() -> Self {
        let (pending, front_end) = (Compare::OFF, FrontEndState::default());
        Self { current: AlphaBeta::ZERO, pending, v_dc: 311.0, only: None, front_end, random: 1 }
    }

    fn sample(&self) -> Sample {
        let i = self.current.to_abc();
        let noise = |shift: u32| (self.random >> shift & 3) as f32 - 1.0;
        let code = |line: Line, i: f32, noise| ((i - line.offset) / line.gain + noise) as u16;
        Sample {
            heat_sink: 1309,
            current_a: code(Line::CHANNEL_A, i.a, noise(16)),
            current_b: code(Line::CHANNEL_B, i.b, noise(24)),
            dc_link: (self.v_dc / 0.11) as u16,
            ..Sample::default()
        }
    }

    /// Runs a period of the drive, without a period of the load.
    fn step(&mut self, drive: &mut Drive) -> Compare {
        self.step_with(drive, &self.sample())
    }

    fn step_with(&mut self, drive: &mut Drive, sample: &Sample) -> Compare {
        step(drive, &mut self.front_end, sample)
    }

    fn advance(&mut self, compare: Compare) {
        let p = self.pending;
        let duty = |c: u16| f32::from(c) / 14_167.0 * self.v_dc;
        let v = Abc::new(duty(p.a), duty(p.b), duty(p.c)).to_alpha_beta();
        self.current = self.current * 0.980_053 + v * 0.003_205_2;
        if let Some(axis) = self.only {
            let along = self.current.alpha * axis.cos + self.current.beta * axis.sin;
            self.current = AlphaBeta::along(axis, along);
        }
        self.pending = compare;
        self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    }
}

fn settings() -> Settings {
    let mut settings = Settings { angle_source: AngleSource::Encoder, ..Settings::default() };
    // The load has no dead time.
    settings.inverter.compensate = false;
    // The load is used with the saliency of the settings.
    settings.injection.synchronous.allow_unlearned = true;
    settings
}

/// Returns settings of a sensorless drive on this load, which has no saliency.
fn sensorless() -> Settings {
    let mut settings = settings();
    settings.angle_source = AngleSource::Injection;
    settings.injection.synchronous.check = false;
    settings
}

fn drive() -> Drive {
    Drive::new(settings().build().unwrap())
}

/// Runs until the drive is in `state`; returns false if it is not after three seconds.
fn run_to(drive: &mut Drive, load: &mut Load, state: State) -> bool {
    for _ in 0..18_000 {
        if drive.state() == state {
            return true;
        }
        period(drive, load);
    }
    false
}

/// Runs a period of drive and load.
fn period(drive: &mut Drive, load: &mut Load) {
    let compare = load.step(drive);
    load.advance(compare);
}

fn running() -> (Drive, Load) {
    let (mut drive, mut load) = (drive(), Load::new());
    drive.command(&Command::Start(Mode::Torque)).unwrap();
    assert!(run_to(&mut drive, &mut load, State::Torque));
    (drive, load)
}

/// Returns the part of a drive that regulates the current.
fn field(drive: &mut Drive) -> &mut Field<PrintedState> {
    match &mut drive.phase {
        Phase::Field(field) => field,
        other => panic!("{other:?}"),
    }
}

/// Returns the speed reference of a drive that starts, turns/s.
fn speed(drive: &Drive) -> Option<f32> {
    match drive.phase {
        Phase::Prepare(Prepare { job: Start::Field(Goal::Speed { speed, .. }), .. }) => Some(speed),
        _ => None,
    }
}

#[test]
fn start_goes_through_its_states_and_stop_ramps_to_off() {
    let (mut drive, mut load) = (drive(), Load::new());
    assert_eq!(load.step(&mut drive), Compare::OFF);
    drive.command(&Command::Start(Mode::Torque)).unwrap();

    let mut seen = vec![];
    let mut low_sides = 0;
    for _ in 0..10_000 {
        if seen.last() != Some(&drive.state()) {
            seen.push(drive.state());
        }
        let compare = load.step(&mut drive);
        match drive.state() {
            State::Calibrating => assert_eq!(compare, Compare::OFF),
            State::Precharge => low_sides += u32::from(compare == Compare::LOW_SIDES_ON),
            _ => {}
        }
        load.advance(compare);
    }
    let all = [State::Calibrating, State::Precharge, State::Magnetising, State::Torque];
    assert_eq!(seen, all);
    assert!((58..=61).contains(&low_sides), "10 ms of low sides: {low_sides} periods");

    // With two settled references, the loop has no steady error except the step of the ADC.
    for (i_q, expected) in [(2.0, 2.0), (-1.0, -1.0)] {
        drive.command(&Command::Torque(i_q)).unwrap();
        for _ in 0..1200 {
            let compare = load.step(&mut drive);
            load.advance(compare);
        }
        let t = drive.telemetry();
        assert!((t.current.q - expected).abs() < 0.01 && (t.current.d - 0.7).abs() < 0.01);
    }

    drive.command(&Command::Stop(Stop::Coast)).unwrap();
    let before = drive.telemetry().reference.q;
    assert!(run_to(&mut drive, &mut load, State::Off));
    assert_eq!(load.step(&mut drive), Compare::OFF);
    // The current is ramped down, 1 A at 30 A/s.
    assert!(before < -0.9);
}

#[cfg_attr(not(feature = "flying-start"), ignore)]
#[test]
fn a_relock_is_for_a_sensorless_drive_that_runs() {
    let (mut encoder, _) = running();
    assert_eq!(encoder.command(&Command::Relock), Err(Refused::NeedsInjection));
    assert_eq!(encoder.state(), State::Torque);
    let (mut drive, mut load) = (Drive::new(sensorless().build().unwrap()), Load::new());
    assert_eq!(drive.command(&Command::Relock), Err(Refused::State(State::Off)));
    drive.command(&Command::Start(Mode::Torque)).unwrap();
    assert_eq!(drive.command(&Command::Relock), Err(Refused::State(State::Calibrating)));
    assert!(run_to(&mut drive, &mut load, State::Torque));
    drive.command(&Command::Torque(1.0)).unwrap();
    assert_eq!(drive.command(&Command::Relock), Ok(Accepted::AsGiven));
    assert_eq!(drive.state(), State::Magnetising);
    assert_eq!(drive.kept.references.current, Dq::new(0.7, 0.0));
    assert!(run_to(&mut drive, &mut load, State::Verifying));
    assert!(run_to(&mut drive, &mut load, State::Torque));
}

#[test]
fn what_is_not_finite_is_named_and_leaves_nothing_behind() {
    type Break = fn(&mut Drive);
    let cases: [(Break, Fault); 6] = [
        (|d| d.c.current_loop.d.k_c = f32::NAN, Fault::NonFiniteSettings),
        (|d| d.c.front_end.current_a.gain = f32::NAN, Fault::NonFiniteSettings),
        (|d| d.kept.references.current.q = f32::NAN, Fault::NonFiniteCommand),
        (|d| field(d).current_loop.back_calculate(Dq::new(f32::NAN, 0.0)), Fault::NonFiniteState),
        (|d| field(d).estimator.axis.rotor_freq = f32::NAN, Fault::NonFiniteState),
        (
            |d| {
                let nan = AlphaBeta::new(f32::NAN, 0.0);
                LPF.step(&mut field(d).low_pass, nan);
            },
            Fault::NonFiniteState,
        ),
    ];
    for (number, (break_it, fault)) in cases.into_iter().enumerate() {
        let mut good = settings();
        if number == 4 {
            good.angle_source = AngleSource::Injection;
            // This load has no saliency and no back-EMF.
            good.injection.synchronous.check = false;
            good.sequence.flying_start = false;
        }
        let (mut drive, mut load) = (Drive::new(good.build().unwrap()), Load::new());
        drive.command(&Command::Start(Mode::Torque)).unwrap();
        assert!(run_to(&mut drive, &mut load, State::Torque));
        break_it(&mut drive);
        let mut compare = load.step(&mut drive);
        if number == 2 {
            // The output of the reference filter follows in the next step.
            compare = load.step(&mut drive);
        }
        assert_eq!((compare, drive.state()), (Compare::OFF, State::Fault(fault)), "case {number}");
        drive.command(&Command::Clear).unwrap();
        drive.command(&Command::Configure(good.build().unwrap())).unwrap();
        load = Load::new();
        drive.command(&Command::Start(Mode::Torque)).unwrap();
        assert!(run_to(&mut drive, &mut load, State::Torque), "case {number}: {}", drive.state());
    }
}

/// The compare values are output before the checks that are made once an injection period. A check that fails cancels them in the
/// same period.
#[test]
fn a_late_check_takes_the_compare_values_back() {
    let (mut drive, mut load) = running();
    drive.c.protection.rotor_freq = -1.0;
    let mut put_out = vec![];
    for _ in 0..CARRIER_SAMPLES {
        put_out.clear();
        let sample = load.sample();
        let (compare, output) =
            drive.period(&mut load.front_end, &sample, &mut |compare| put_out.push(compare));
        assert_eq!(put_out.last(), Some(&compare));
        assert_eq!(
            (put_out.len(), compare.enabled),
            if drive.is_off() { (2, false) } else { (1, true) }
        );
        assert!(put_out[0].enabled && output.duties.is_some() != drive.is_off());
        if drive.is_off() {
            break;
        }
        load.advance(compare);
    }
    assert_eq!(drive.state(), State::Fault(Fault::OverSpeed));
}

/// The period that leaves time for a command is the one after which nothing else of the injection period is computed.
#[test]
fn one_period_of_ten_leaves_time_for_a_command() {
    let off = drive();
    assert!(off.has_time());
    let (mut drive, mut load) = running();
    let times: Vec<bool> = (0..40)
        .map(|_| {
            period(&mut drive, &mut load);
            drive.has_time()
        })
        .collect();
    let first = times.iter().position(|&time| time).unwrap();
    let expected = (0..40).map(|n| n % CARRIER_SAMPLES == first);
    assert!(first < CARRIER_SAMPLES && times.iter().copied().eq(expected), "{times:?}");
}

/// A build without a block refuses to start in its mode, with the reason.
#[test]
fn a_mode_that_is_left_out_is_refused() {
    let built = [
        (Mode::VoltsPerHertz, Vf::IN_BUILD.is_some()),
        (Mode::Position, Position::IN_BUILD.is_some()),
        (Mode::Torque, true),
    ];
    for (mode, built) in built {
        let started = Drive::new(settings().build().unwrap()).command(&Command::Start(mode));
        assert_eq!(started == Err(Refused::NotBuilt), !built, "{mode:?}: {started:?}");
    }
}

#[cfg_attr(not(feature = "position"), ignore)]
#[test]
fn commands_are_taken_limited_or_refused() {
    let mut d = drive();
    let coefficients = settings().build().unwrap();
    assert_eq!(d.command(&Command::Torque(1.0)), Err(Refused::State(State::Off)));
    assert_eq!(d.state(), State::Off);

    let (mut d, _) = running();
    assert_eq!(d.command(&Command::Start(Mode::Torque)), Err(Refused::State(State::Torque)));
    assert_eq!(d.command(&Command::Configure(coefficients)), Err(Refused::State(State::Torque)));
    assert_eq!(d.command(&Command::Torque(1.0)), Ok(Accepted::AsGiven));
    assert_eq!(d.command(&Command::Torque(f32::NAN)), Err(Refused::NotFinite));
    assert_eq!(d.command(&Command::Torque(f32::INFINITY)), Err(Refused::NotFinite));
    assert_eq!(d.kept.references.current.q, 1.0, "refused commands change nothing");
    // The largest current is sqrt(3.5^2 - 0.7^2).
    let Ok(Accepted::Limited(most)) = d.command(&Command::Torque(-99.0)) else { panic!() };
    assert!((most + 3.429).abs() < 1e-3);
    assert_eq!(
        d.command(&Command::Position(1.0)),
        Err(Refused::State(State::Torque)),
        "position belongs to another mode"
    );
    assert!(matches!(d.command(&Command::Magnetising(0.0)), Err(Refused::OutOfRange { .. })));

    let mut d = drive();
    assert_eq!(d.command(&Command::Speed(1.0)), Err(Refused::State(State::Off)));
    d.command(&Command::Start(Mode::Speed)).unwrap();
    assert_eq!(d.command(&Command::Speed(-120.0)), Ok(Accepted::AsGiven));
    assert_eq!(d.command(&Command::Speed(f32::NAN)), Err(Refused::NotFinite));
    assert_eq!(d.command(&Command::Torque(1.0)), Err(Refused::State(State::Speed)));
    assert_eq!(speed(&d), Some(-2.0), "refused commands change nothing");
    assert_eq!(d.command(&Command::Speed(1e6)), Ok(Accepted::Limited(300.0)));
    d.command(&Command::Stop(Stop::Coast)).unwrap();
    d.command(&Command::Start(Mode::Speed)).unwrap();
    assert_eq!(speed(&d), Some(0.0), "a start takes the references back");
    d.command(&Command::Stop(Stop::Coast)).unwrap();
    d.command(&Command::Start(Mode::Position)).unwrap();
    assert_eq!(d.command(&Command::Speed(1.0)), Err(Refused::State(State::Position)));
    assert_eq!(d.command(&Command::Position(-1e9)), Ok(Accepted::Limited(-1000.0)));
    // While the drive starts, there is nothing to press against, and no position that could be 0.
    let starting = Err(Refused::State(State::Calibrating));
    assert_eq!(d.command(&Command::Press(30.0, 0.5)), starting);
    assert_eq!(d.command(&Command::Home(0.0)), starting);
}

#[test]
fn a_test_voltage_is_put_out_bounded_and_taken_back() {
    let (mut d, _) = running();
    let volts = Dq::new(20.0, -10.0);
    assert_eq!(d.command(&Command::TestVoltage(volts)), Ok(Accepted::AsGiven));
    assert_eq!(d.kept.references.test_voltage, volts);
    let refused = d.command(&Command::TestVoltage(Dq::new(0.0, 61.0)));
    assert_eq!(refused, Err(Refused::OutOfRange { min: -60.0, max: 60.0 }));
    let refused = d.command(&Command::TestVoltage(Dq::new(f32::NAN, 0.0)));
    assert_eq!(refused, Err(Refused::NotFinite));
    assert_eq!(d.kept.references.test_voltage, volts, "refused commands change nothing");
    d.command(&Command::Stop(Stop::Coast)).unwrap();
    assert!(matches!(d.command(&Command::TestVoltage(volts)), Err(Refused::State(_))));
}

/// The injection is along the flux for the demodulation of Ha and Sul, and along the q axis otherwise.
#[test]
fn a_start_puts_the_injection_on_its_axis() {
    for (kind, axis) in [
        (DemodulatorKind::RmsImpedance, UnitVector { cos: 1.0, sin: 0.0 }),
        (DemodulatorKind::Synchronous, UnitVector { cos: 0.0, sin: 1.0 }),
    ] {
        let mut s = settings();
        s.injection.demodulator = kind;
        let mut d = Drive::new(s.build().unwrap());
        d.command(&Command::Start(Mode::Torque)).unwrap();
        let mut load = Load::new();
        assert!(run_to(&mut d, &mut load, State::Magnetising));
        assert_eq!(d.kept.references.injection_axis, axis);
        assert_eq!(field(&mut d).axes.injection, axis);
    }
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    type Change = fn(&mut Settings);
    let cases: [(Change, &str); 12] = [
        (|s| s.speed.limit_rpm = Some(3000.0), "speed.limit_rpm = 3000: allowed is 1 to 2000 rpm"),
        (
            |s| s.speed.phase_margin_deg = 80.0,
            "speed.phase_margin_deg = 80: allowed is 45 to 70 deg",
        ),
        (|s| s.motor.r_s = f32::NAN, "motor.r_s = NaN: allowed is 0.0001 to 1000 ohm"),
        (|s| s.motor.l_m = 0.0, "motor.l_m = 0"),
        (|s| s.limits.trip_a = Some(5.0), "limits.trip_a = 5"),
        (
            |s| s.injection.amplitude_v = Some(-1.0),
            "injection.amplitude_v = -1: allowed is 0 to 171.",
        ),
        (|s| s.sequence.i_d = Some(9.0), "sequence.i_d = 9"),
        (
            |s| s.injection.synchronous.allowed_deficit = 2.0,
            "injection.allowed_deficit = 2: allowed is 0.3 to 0.9",
        ),
        (|s| s.injection.synchronous.deficit_s = f32::NAN, "injection.deficit_s = NaN"),
        (
            |s| {
                *s = sensorless();
                s.sequence.magnetise_s = Some(0.1);
            },
            "sequence.magnetise_s = 0.1: allowed is 0.5 to 60 s",
        ),
        (|s| s.inverter.dead_time_s = 1e-3, "inverter.dead_time_s = 0.001"),
        (
            |s| s.current_plant.d = IdentifiedPlant { k: None, p: Some(1.5) },
            "current_plant.d.p = 1.5: allowed is 0 to",
        ),
    ];
    for (change, text) in cases {
        let mut bad = settings();
        change(&mut bad);
        let error = bad.build().unwrap_err().to_string();
        assert!(error.starts_with(text), "{error}");
    }
}

/// Returns samples that a host, a bit flip or a broken wire can cause.
fn any_sample() -> impl Strategy<Value = Sample> {
    (0u16..=4095, 0u16..=4095, 0u16..=4095, any::<u32>(), 0u8..20).prop_map(
        |(current_a, current_b, dc_link, encoder, n)| Sample {
            current_a,
            current_b,
            current_c: current_b,
            dc_link,
            heat_sink: 1309,
            encoder: if n < 10 { 0 } else { encoder },
            hardware: if n == 19 { Hardware::BREAK } else { Hardware::empty() },
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn anything_may_come_in(
        samples in prop::collection::vec((any_sample(), 0u8..8, any::<f32>()), 1..300),
        injection in any::<bool>(),
    ) {
        let source = if injection { AngleSource::Injection } else { AngleSource::Encoder };
        let mut s = Settings { angle_source: source, ..settings() };
        s.sequence.calibrate_s = 0.001;
        s.sequence.magnetise_s = Some(0.001);
        let mut drive = Drive::new(s.build().unwrap());
        let (quiet, mut front_end) = (Load::new().sample(), FrontEndState::default());
        for (n, (sample, command, value)) in samples.into_iter().enumerate() {
            let _ = drive.command(&match command {
                0 => Command::Start(Mode::Torque),
                1 => Command::Start(if n % 2 == 0 { Mode::Position } else { Mode::Speed }),
                2 => Command::Torque(value),
                3 if n % 2 == 0 => Command::Position(value),
                3 => Command::Speed(value),
                4 => Command::Magnetising(value),
                5 => Command::TurnInjection(value),
                _ => Command::Clear,
            });
            // Most samples are quiet, so that the drive advances.
            let sample = if n % 40 == 39 { &sample } else { &quiet };
            let compare = step(&mut drive, &mut front_end, sample);
            prop_assert!(compare.a <= 14_167 && compare.b <= 14_167 && compare.c <= 14_167);
            if matches!(drive.state(), State::Off | State::Fault(_)) {
                prop_assert!(!compare.enabled);
            }
        }
    }
}
