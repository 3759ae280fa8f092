//! The rotor time constant while the drive runs: [`Online`] in the main loop, fed by the control
//! interrupt period by period.

use core::f32::consts::TAU;
use core::fmt;

use drive_core::identify::online::{NoEstimate, Online, RotorEstimate, SpeedInput};
use drive_core::io::PERIOD_S;
use drive_core::math::decimal::Fixed;
use drive_core::settings::AngleSource;
use drive_core::{Accepted, AlphaBeta, Dq, Settings, Telemetry};

use crate::board;

/// Control periods from one fit of the machine to the next: ten a second.
const PERIODS_PER_FIT: u32 = board::PWM_HZ / 10;

/// What a control period shows of the motor. The numbers count up while the drive regulates: where
/// one is missing there is a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    number: u32,
    measured: AlphaBeta,
    realised: AlphaBeta,
    reference: Dq,
    rotor_freq: f32,
}

impl Seen {
    /// What control period `number` has seen and done.
    #[inline]
    pub fn new(number: u32, t: &Telemetry) -> Self {
        let Telemetry { measured, realised, reference, rotor_freq, .. } = *t;
        Self { number, measured, realised, reference, rotor_freq }
    }
}

/// The estimate and what becomes of it.
#[derive(Clone, Copy, Debug)]
pub struct Tracking {
    online: Online,
    source: AngleSource,
    /// Number of the period that comes next, if there is no gap.
    next: u32,
    /// Periods until the next fit.
    wait: u32,
    report: Report,
}

/// For the console.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// The estimate, or why there is none.
    pub found: Result<RotorEstimate, NoEstimate>,
    /// Rotor time constant that the drive uses, s.
    pub used: f32,
}

impl Tracking {
    /// For a drive that has just taken these settings; nothing if they do not want it.
    pub fn new(settings: &Settings) -> Option<Self> {
        if !settings.track_rotor {
            return None;
        }
        Some(Self {
            online: Online::new(settings).ok()?,
            source: settings.angle_source,
            next: 0,
            wait: PERIODS_PER_FIT,
            report: Report { found: Err(NoEstimate::Settling), used: settings.motor.tau_r() },
        })
    }

    /// Takes what the next period has seen. Ten times a second it gives a rotor time constant to be
    /// ordered, s, if there is an estimate.
    pub fn take(&mut self, seen: &Seen) -> Option<f32> {
        if seen.number != self.next {
            // The drive did not regulate, or the main loop came too late.
            self.online.restart();
            self.wait = PERIODS_PER_FIT;
            self.report.found = Err(NoEstimate::Settling);
        }
        self.next = seen.number.wrapping_add(1);
        self.online.push(seen.measured, seen.realised);
        self.wait = self.wait.saturating_sub(1);
        if self.wait > 0 {
            return None;
        }
        self.wait = PERIODS_PER_FIT;
        let omega_m = seen.rotor_freq * (TAU / PERIOD_S);
        let speed = match self.source {
            AngleSource::Encoder => SpeedInput::Known(omega_m),
            AngleSource::Injection => SpeedInput::Guess(omega_m),
        };
        self.report.found = self.online.refine(seen.reference, speed);
        self.report.found.ok().map(|tracked| tracked.tau_r)
    }

    /// What the drive makes of the time constant `tau_r` that it was ordered, s.
    pub fn taken(&mut self, tau_r: f32, taken: Accepted) {
        self.report.used = match taken {
            Accepted::AsGiven => tau_r,
            Accepted::Limited(used) => used,
        };
    }

    /// For the console.
    pub fn report(&self) -> Report {
        self.report
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |s: f32| Fixed::<1>(1e3 * s);
        match &self.found {
            Ok(t) => {
                write!(f, "tau_r {} ms +-{} %", ms(t.tau_r), Fixed::<1>(100.0 * t.uncertainty))?;
            }
            Err(doubt) => write!(f, "tau_r not found: {doubt}")?,
        }
        write!(f, "; used {} ms", ms(self.used))
    }
}

#[cfg(test)]
mod tests {
    use drive_core::{Command, Mode};
    use hil_sim::Config;
    use hil_sim::config::AngleSource as Source;
    use hil_sim::rig::{Rig, drive_settings, plant_settings};

    use super::*;
    use crate::link::ring::Ring;

    /// A drive at 2 A on a locked shaft whose rotor has 30 % more resistance than it believes, and its
    /// tracking.
    fn tracked() -> (Rig, Tracking) {
        let mut config = Config::default();
        config.angle.source = Source::Encoder;
        let settings = Settings { track_rotor: true, ..drive_settings(&config) };
        config.motor.rr *= 1.3;
        let mut rig = Rig::new(&plant_settings(&config), &settings, 5).unwrap();
        rig.start(Mode::Torque).unwrap();
        rig.command(&Command::Torque(2.0)).unwrap();
        rig.run(0.5, |_| {});
        assert!(rig.drive.tracks_rotor());
        (rig, Tracking::new(&settings).unwrap())
    }

    fn seen(rig: &mut Rig, number: u32) -> Seen {
        rig.step();
        Seen::new(number, &rig.drive.telemetry())
    }

    #[test]
    fn only_settings_that_want_it_are_tracked() {
        assert!(Tracking::new(&board::settings()).is_none());
        let settings = Settings { track_rotor: true, ..board::settings() };
        assert!(Tracking::new(&settings).is_some());
    }

    #[test]
    fn the_drive_gets_the_time_constant_of_its_motor() {
        let (mut rig, mut tracking) = tracked();
        let truth = rig.plant.motor().machine.tau_r();
        let mut ordered = Vec::new();
        // The numbers wrap on the way.
        for n in 0..60_000_u32 {
            let number = (u32::MAX - 9).wrapping_add(n);
            if let Some(tau_r) = tracking.take(&seen(&mut rig, number)) {
                assert_eq!((n + 1) % PERIODS_PER_FIT, 0);
                let taken = rig.drive.command(&Command::RotorTimeConstant(tau_r)).unwrap();
                tracking.taken(tau_r, taken);
                ordered.push(tau_r);
            }
        }
        // Ten a second after three seconds of settling.
        assert!((65..=71).contains(&ordered.len()), "{}", ordered.len());
        // Within 6 %, as measured by `cargo sim run online-tracking`, and what the drive uses is that.
        for tau_r in [ordered[ordered.len() - 1], tracking.report().used] {
            assert!((f64::from(tau_r) / truth - 1.0).abs() < 0.06, "{tau_r} for {truth}");
        }
    }

    #[test]
    fn a_main_loop_that_comes_too_late_begins_anew() {
        let (mut rig, mut tracking) = tracked();
        let mut ring = Ring::<Seen, { board::SEEN_PERIODS }>::new();
        let (mut write, mut read) = ring.split();
        let (mut orders, mut lost) = (Vec::new(), 0);
        for n in 0..60_000_u32 {
            if !write.push(seen(&mut rig, n)) {
                lost += 1;
            }
            // It hangs for 100 periods once, and else comes every 20.
            if n % 20 == 19 && !(30_000..30_100).contains(&n) {
                while let Some(seen) = read.pop() {
                    orders.extend(tracking.take(&seen).map(|_| n));
                }
            }
            if n == 30_200 {
                assert_eq!(tracking.report().found, Err(NoEstimate::Settling));
            }
        }
        assert!((30..60).contains(&lost), "{lost}");
        let (before, after): (Vec<u32>, Vec<u32>) = orders.iter().partition(|n| **n < 30_000);
        assert!(before.len() > 15 && after.len() > 15, "{orders:?}");
        // The memory of the least squares is filled again first.
        assert!(after.iter().all(|n| *n > 30_100 + 29 * PERIODS_PER_FIT), "{after:?}");
    }
}
