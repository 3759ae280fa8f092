//! The rotor time constant while the drive runs: [`Online`] in the main loop, fed by the control
//! interrupt period by period.

use core::f32::consts::TAU;
use core::fmt;

use drive_core::decimal::Fixed;
use drive_core::online::{Doubt, Online, Speed, Tracked};
use drive_core::settings::{AngleSource, PERIOD_S};
use drive_core::{AlphaBeta, Dq, Settings, Taken, Telemetry};

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
    rotor_step: f32,
}

impl Seen {
    /// What control period `number` has seen and done.
    #[inline]
    pub fn new(number: u32, t: &Telemetry) -> Self {
        let Telemetry { measured, realised, reference, rotor_step, .. } = *t;
        Self { number, measured, realised, reference, rotor_step }
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
    pub found: Result<Tracked, Doubt>,
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
            report: Report { found: Err(Doubt::Settling), used: settings.motor.t_sec() },
        })
    }

    /// Takes what the next period has seen. Ten times a second it gives a rotor time constant to be
    /// ordered, s, if there is an estimate.
    pub fn take(&mut self, seen: &Seen) -> Option<f32> {
        if seen.number != self.next {
            // The drive did not regulate, or the main loop came too late.
            self.online.restart();
            self.wait = PERIODS_PER_FIT;
            self.report.found = Err(Doubt::Settling);
        }
        self.next = seen.number.wrapping_add(1);
        self.online.push(seen.measured, seen.realised);
        self.wait = self.wait.saturating_sub(1);
        if self.wait > 0 {
            return None;
        }
        self.wait = PERIODS_PER_FIT;
        let omega_m = seen.rotor_step * (TAU / PERIOD_S);
        let speed = match self.source {
            AngleSource::Encoder => Speed::Known(omega_m),
            AngleSource::Injection => Speed::Guess(omega_m),
        };
        self.report.found = self.online.refine(seen.reference, speed);
        self.report.found.ok().map(|tracked| tracked.tau_r)
    }

    /// What the drive makes of the time constant `tau_r` that it was ordered, s.
    pub fn taken(&mut self, tau_r: f32, taken: Taken) {
        self.report.used = match taken {
            Taken::AsGiven => tau_r,
            Taken::Limited(used) => used,
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
