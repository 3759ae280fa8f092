//! Online identification of the rotor time constant: [`Online`] in the main loop, fed by the control
//! interrupt period by period.

use core::f32::consts::TAU;
use core::fmt;

use drive_core::io::PERIOD_S;
use drive_core::{Accepted, AngleSource};
use drive_settings::Settings;
use rotor_id::online::{NoEstimate, Online, RotorEstimate, SpeedInput};

use crate::board;
use crate::recording::ring::Record;

/// Control periods from one fit of the machine to the next: ten fits per second.
const PERIODS_PER_FIT: u32 = board::PWM_HZ / 10;

/// The estimate, and the value that the drive uses.
#[derive(Clone, Copy, Debug)]
pub struct Tracking {
    online: Online,
    source: AngleSource,
    /// Number of the next period, if there is no gap.
    next: u32,
    /// Periods until the next fit.
    wait: u32,
    report: Report,
}

/// State of the tracking, for the console.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// The estimate, or the reason why there is none.
    pub estimate: Result<RotorEstimate, NoEstimate>,
    /// Rotor time constant in use, s.
    pub used: f32,
}

impl Tracking {
    /// The tracking for a drive that has just taken these settings; `None` if they do not enable it.
    pub fn new(settings: &Settings) -> Option<Self> {
        if !settings.track_rotor {
            return None;
        }
        Some(Self {
            online: Online::new(settings).ok()?,
            source: settings.angle_source,
            next: 0,
            wait: PERIODS_PER_FIT,
            report: Report { estimate: Err(NoEstimate::Settling), used: settings.motor.tau_r() },
        })
    }

    /// Takes the next [observed](Record::observed) period. Ten times a second it returns the estimated rotor time constant, s, for
    /// [`Command::RotorTimeConstant`](drive_core::Command::RotorTimeConstant), if there is one.
    pub fn take(&mut self, seen: &Record) -> Option<f32> {
        if seen.period != self.next {
            // Either the drive did not regulate, or the main loop came too late.
            self.online.restart();
            self.wait = PERIODS_PER_FIT;
            self.report.estimate = Err(NoEstimate::Settling);
        }
        self.next = seen.period.wrapping_add(1);
        let signals = &seen.telemetry;
        self.online.push(signals.measured, signals.realised);
        self.wait = self.wait.saturating_sub(1);
        if self.wait > 0 {
            return None;
        }
        self.wait = PERIODS_PER_FIT;
        let omega_m = signals.rotor_freq * (TAU / PERIOD_S);
        let speed = match self.source {
            AngleSource::Encoder => SpeedInput::Known(omega_m),
            AngleSource::Injection => SpeedInput::Guess(omega_m),
        };
        self.report.estimate = self.online.refine(signals.reference, speed);
        self.report.estimate.ok().map(|tracked| tracked.tau_r)
    }

    /// Notes the drive's answer to the time constant `tau_r`, s.
    pub fn taken(&mut self, tau_r: f32, answer: Accepted) {
        self.report.used = match answer {
            Accepted::AsGiven => tau_r,
            Accepted::Limited(used) => used,
        };
    }

    /// The present state.
    pub fn report(&self) -> Report {
        self.report
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.estimate {
            Ok(t) => write!(f, "tau_r {:.1} ms +-{:.1} %", 1e3 * t.tau_r, 100.0 * t.uncertainty)?,
            Err(doubt) => write!(f, "tau_r not found: {doubt}")?,
        }
        write!(f, "; used {:.1} ms", 1e3 * self.used)
    }
}

#[cfg(test)]
mod tests {
    use drive_core::{Command, Mode};
    use hil_sim::Config;
    use hil_sim::config::plant_settings;
    use hil_sim::rig::Rig;

    use super::*;
    use crate::recording::ring::{self, Ring};

    /// A drive at 2 A on a locked shaft whose rotor has 30 % more resistance than in the settings, and its tracking.
    fn tracked() -> (Rig, Tracking) {
        let mut config = Config::default();
        config.drive.angle_source = AngleSource::Encoder;
        let settings = Settings { track_rotor: true, ..config.drive };
        config.motor.r_r *= 1.3;
        let mut rig = Rig::new(&plant_settings(&config), &settings, 5).unwrap();
        rig.start(Mode::Torque).unwrap();
        rig.command(&Command::Torque(2.0)).unwrap();
        rig.wait(0.5);
        assert!(rig.drive.tracks_rotor());
        (rig, Tracking::new(&settings).unwrap())
    }

    fn observe(rig: &mut Rig, period: u32) -> Record {
        rig.step();
        Record { period, telemetry: *rig.drive.telemetry(), ..Record::default() }
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
        let truth = rig.plant.tau_r();
        let mut ordered = Vec::new();
        // The numbers wrap during the run.
        for n in 0..60_000_u32 {
            let number = (u32::MAX - 9).wrapping_add(n);
            if let Some(tau_r) = tracking.take(&observe(&mut rig, number)) {
                assert_eq!((n + 1) % PERIODS_PER_FIT, 0);
                let taken = rig.drive.command(&Command::RotorTimeConstant(tau_r)).unwrap();
                tracking.taken(tau_r, taken);
                ordered.push(tau_r);
            }
        }
        // Ten estimates per second after three seconds of settling.
        assert!((65..=71).contains(&ordered.len()), "{}", ordered.len());
        // Within 6 %, as measured by `cargo sim run online-tracking`; the drive uses this value.
        for tau_r in [ordered[ordered.len() - 1], tracking.report().used] {
            assert!((f64::from(tau_r) / truth - 1.0).abs() < 0.06, "{tau_r} for {truth}");
        }
    }

    #[test]
    fn a_main_loop_that_comes_too_late_begins_anew() {
        let (mut rig, mut tracking) = tracked();
        let mut ring = Ring::<{ ring::PERIODS }>::new();
        let (mut writer, mut reader) = ring.split();
        let (mut orders, mut taken) = (Vec::new(), 0);
        for n in 0..60_000_u32 {
            let seen = observe(&mut rig, n);
            writer.write(|record| *record = seen);
            // The main loop hangs for 100 periods once, and comes every 20 otherwise.
            if n % 20 == 19 && !(30_000..30_100).contains(&n) {
                for seen in reader.by_ref() {
                    taken += 1;
                    orders.extend(tracking.take(&seen).map(|_| n));
                }
            }
            if n == 30_200 {
                assert_eq!(tracking.report().estimate, Err(NoEstimate::Settling));
            }
        }
        // The rest of the pause, and of the pass before it, does not fit.
        assert_eq!(taken, 60_000 - 120 + ring::PERIODS - 1);
        let (before, after): (Vec<u32>, Vec<u32>) = orders.iter().partition(|n| **n < 30_000);
        assert!(before.len() > 15 && after.len() > 15, "{orders:?}");
        // The memory of the least squares is filled again first.
        assert!(after.iter().all(|n| *n > 30_100 + 29 * PERIODS_PER_FIT), "{after:?}");
    }
}
