//! Tests of the ways to stop.

use super::*;

/// From every mode, with and without an encoder, by either ramp: the speed follows the ramp from its present value, within the
/// error due to the unknown load (0.3 Nm are 240 rpm/s on the inertia). The q-axis current jumps by no more than the current
/// of the ramp, and the outputs are switched off with the shaft at rest. A torque that was commanded while the drive starts is
/// not applied by a stop.
#[cfg_attr(not(feature = "flying-start"), ignore)]
#[test]
fn a_stop_before_the_run_puts_out_no_torque() {
    for state in [State::FlyingStart, State::Magnetising, State::Verifying] {
        let mut bench = Bench::new(&motor_settings(AngleSource::Injection));
        bench.drive.command(&Command::Start(Mode::Torque)).unwrap();
        assert!(bench.run_to(state), "{state}");
        bench.drive.command(&Command::Torque(2.0)).unwrap();
        bench.drive.command(&Command::Stop(Stop::Coast)).unwrap();
        for _ in 0..3 {
            bench.step();
            assert_eq!(bench.drive.telemetry().reference.q, 0.0, "{state}");
        }
        assert_eq!(bench.drive.state(), State::Off, "{state}");
    }
}

#[cfg_attr(not(feature = "position"), ignore)]
#[test]
fn a_stop_by_ramp_brings_the_shaft_to_rest_from_every_mode() {
    for source in [AngleSource::Encoder, AngleSource::Injection] {
        for (mode, stop, ramp) in [
            (Mode::Torque, Stop::Ramp, 300.0),
            (Mode::Torque, Stop::Quick, 900.0),
            (Mode::Speed, Stop::Ramp, 300.0),
            (Mode::Speed, Stop::Quick, 900.0),
            (Mode::Position, Stop::Ramp, 300.0),
        ] {
            let mut bench = Bench::started(&motor_settings(source), mode);
            match mode {
                Mode::Torque => bench.drive.command(&Command::Torque(-1.0)),
                Mode::Speed => bench.drive.command(&Command::Speed(-300.0)),
                _ => bench.drive.command(&Command::Position(-20.0)),
            }
            .unwrap();
            while bench.motor.rpm() > -250.0 {
                bench.step();
            }
            let (rpm, before) = (bench.motor.rpm(), bench.drive.telemetry().reference.q);
            bench.drive.command(&Command::Stop(stop)).unwrap();
            assert_eq!(bench.drive.state(), State::Braking);
            let refused = bench.drive.command(&Command::Speed(10.0));
            assert!(refused.is_err(), "{refused:?}");
            bench.run(0.005);
            // The reference continues from its present value: the current of the ramp is 1 A for 260 rpm/s.
            let jump = f64::from(bench.drive.telemetry().reference.q - before).abs();
            let had = if mode == Mode::Torque { 0.0 } else { 300.0 };
            assert!(jump < (ramp + had) / 256.0 + 0.3, "{source:?} {mode:?} {stop:?}: {jump} A");
            let at = -rpm / ramp;
            bench.run(0.7 * at);
            let expected = 0.3 * rpm;
            let error = (bench.motor.rpm() - expected).abs();
            assert!(error < 45.0, "{source:?} {mode:?} {stop:?}: {error} rpm");
            let mut most = 0.0_f64;
            let stopped = (0..12_000).any(|_| {
                bench.step();
                most = most.max(bench.motor.rpm());
                bench.drive.state() == State::Stopping
            });
            assert!(stopped, "{source:?} {mode:?} {stop:?}: {}", bench.drive.state());
            assert!(bench.motor.rpm().abs() < 15.0 && most < 40.0, "{} {most}", bench.motor.rpm());
            assert!(bench.run_to(State::Off));
        }
    }
}

/// A jog continues while it is repeated, and ends by the ramp 0.5 s after the last one, or by another speed.
#[test]
fn a_jog_lasts_as_long_as_it_is_repeated() {
    let mut bench = Bench::new(&motor_settings(AngleSource::Encoder));
    bench.drive.command(&Command::Start(Mode::Speed)).unwrap();
    let early = bench.drive.command(&Command::Jog(90.0));
    assert_eq!(early, Err(Refused::State(State::Calibrating)));
    assert!(bench.run_to(State::Speed));
    for _ in 0..4 {
        bench.drive.command(&Command::Jog(90.0)).unwrap();
        bench.run(0.45);
    }
    assert!((bench.motor.rpm() - 90.0).abs() < 2.0, "{}", bench.motor.rpm());
    bench.drive.command(&Command::Jog(90.0)).unwrap();
    bench.run(0.49);
    assert!((bench.motor.rpm() - 90.0).abs() < 2.0, "{}", bench.motor.rpm());
    // The ramp takes 0.3 s, and the loop settles.
    bench.run(0.31);
    assert!(bench.motor.rpm() < 30.0, "{}", bench.motor.rpm());
    bench.run(0.5);
    assert!(bench.motor.rpm().abs() < 2.0, "{}", bench.motor.rpm());
    bench.drive.command(&Command::Jog(90.0)).unwrap();
    bench.drive.command(&Command::Speed(-60.0)).unwrap();
    bench.run(2.0);
    assert!((bench.motor.rpm() + 60.0).abs() < 2.0, "{}", bench.motor.rpm());
    let far = bench.drive.command(&Command::Jog(1e6));
    assert_eq!(far, Ok(Accepted::Limited(300.0)));
    let mut torque = Bench::started(&motor_settings(AngleSource::Encoder), Mode::Torque);
    assert!(torque.drive.command(&Command::Jog(90.0)).is_err());
}

/// A stop by ramp can be changed to a quick stop or a coast, but not to a slower one. A drive that is not running yet stops at
/// once.
#[test]
fn a_stop_can_be_made_harder() {
    let braking = |stops: &[Stop]| {
        let mut bench = Bench::started(&motor_settings(AngleSource::Encoder), Mode::Speed);
        bench.drive.command(&Command::Speed(300.0)).unwrap();
        bench.run(1.5);
        for stop in stops {
            bench.drive.command(&Command::Stop(*stop)).unwrap();
            bench.run(0.1);
        }
        bench
    };
    // The speed falls for 0.1 s at 300 rpm/s and for 0.1 s at the 780 rpm/s that 3 A allow, or for 0.2 s at 780 rpm/s.
    for (stops, rpm) in [([Stop::Ramp, Stop::Quick], 190.0), ([Stop::Quick, Stop::Ramp], 145.0)] {
        let bench = braking(&stops);
        assert_eq!(bench.drive.state(), State::Braking);
        assert!((bench.motor.rpm() - rpm).abs() < 25.0, "{}", bench.motor.rpm());
    }
    let bench = braking(&[Stop::Ramp, Stop::Coast]);
    assert_eq!(bench.drive.state(), State::Off);
    assert!(bench.motor.rpm() > 200.0, "{}", bench.motor.rpm());
    let mut bench = Bench::new(&motor_settings(AngleSource::Encoder));
    bench.drive.command(&Command::Start(Mode::Speed)).unwrap();
    bench.drive.command(&Command::Stop(Stop::Quick)).unwrap();
    assert_eq!(bench.drive.state(), State::Off);
}
