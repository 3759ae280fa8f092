//! From off to regulating: offsets, bootstraps, wiring, flux, saliency, lock.

use super::Drive;
use crate::current::inverter_drop::InverterDropState;
use crate::current::sensing::Measured;
use crate::drive::state::{Mode, State};
use crate::fault::Fault;
use crate::io::{Compare, PERIOD_S, Sample};
use crate::math::frames::Dq;
use crate::protect::lock_monitor::LockMonitorState;
use crate::protect::saliency_check::{SaliencyCheck, SaliencyCheckAction};
use crate::protect::wiring_check::{WiringAction, WiringCheckState};
use crate::settings::AngleSource;

/// Periods from the order to switch the low sides on until a sample sees them on, with margin.
const LOW_SIDES_ON_FROM: u32 = 4;

/// Electrical speed up to which the shaft counts as standing, turns per period: 1 Hz, 30 rpm of four poles.
const STANDING_FREQ: f32 = PERIOD_S;

impl Drive {
    /// A step without current control: off, in fault, or on the way to it.
    #[cold]
    pub(super) fn prepare(&mut self, sample: &Sample) -> Result<Compare, State> {
        if matches!(self.state, State::Off | State::Fault(_)) {
            return Ok(Compare::OFF);
        }
        let measured = self.c.sensing.step(&mut self.control.sensing, sample);
        self.c.protect(&self.control.sensing, sample, &measured)?;
        Ok(match self.state {
            State::Calibrating => self.calibrate(sample)?,
            State::Precharge => self.precharge(sample)?,
            State::Exciting => self.excite(&measured)?,
            State::VoltsPerHertz | State::BrakingByFrequency => {
                return self.turn_by_voltage(&measured);
            }
            _ => self.check_wiring(sample, &measured)?,
        })
    }

    fn calibrate(&mut self, sample: &Sample) -> Result<Compare, Fault> {
        let waits = self.waits_for_flux();
        if !waits && self.c.sensing.calibrate(&mut self.control.sensing, sample)?.is_some() {
            // Flux from a run before would meet a short circuit. With a wiring that nobody has checked there was no run.
            if self.control.catching.flux_left.is_some() && !self.wiring_unchecked {
                self.catch_from_here();
            } else {
                self.enter(State::Precharge);
            }
        }
        Ok(Compare::OFF)
    }

    fn precharge(&mut self, sample: &Sample) -> Result<Compare, Fault> {
        // The first samples still see the bridge off.
        if self.elapsed >= LOW_SIDES_ON_FROM {
            self.c.sensing.calibrate_again(&mut self.control.sensing, sample)?;
        }
        if self.elapsed >= self.c.sequence.precharge {
            if self.mode == Mode::Commissioning {
                self.excite_from_here();
            } else if self.mode == Mode::VoltsPerHertz {
                // Its boost checks the wiring.
                self.enter(State::VoltsPerHertz);
            } else if self.wiring_unchecked {
                self.wiring = WiringCheckState::default();
                self.enter(State::CheckingWiring);
            } else {
                self.current_from_here(sample.encoder);
            }
        }
        Ok(Compare::LOW_SIDES_ON)
    }

    /// Short voltage pulses, without control.
    fn check_wiring(&mut self, sample: &Sample, measured: &Measured) -> Result<Compare, Fault> {
        let pulses = self.pulses();
        Ok(match pulses.step(&mut self.wiring, measured.phases)? {
            WiringAction::Apply { voltage, current } => {
                let signs = self.c.dead_time.signs(current.to_abc());
                let compensation = self.c.dead_time.voltage(signs, measured.dc_link, 0.0);
                let modulated = self.c.modulator.step(voltage, compensation, measured.dc_link);
                Compare::on(modulated.compare)
            }
            WiringAction::Ended if self.mode == Mode::Commissioning => {
                self.end_train();
                Compare::LOW_SIDES_ON
            }
            WiringAction::Ended => {
                pulses.judge(&self.wiring.answers())?;
                self.wiring_unchecked = false;
                self.current_from_here(sample.encoder);
                Compare::LOW_SIDES_ON
            }
        })
    }

    /// The first current: to find a turning shaft where there is no encoder, or to magnetise.
    fn current_from_here(&mut self, encoder: u32) {
        if self.can_catch() {
            self.catch_from_here();
        } else {
            self.magnetising_from_here(encoder);
        }
    }

    /// Whether this start looks for a turning shaft. A drive that learns has a locked one.
    pub(super) fn can_catch(&self) -> bool {
        self.c.catching.is_some() && State::of_mode(self.mode).regulates()
    }

    #[cold]
    pub(super) fn magnetising_from_here(&mut self, encoder: u32) {
        let s = &mut self.control;
        (s.lock, s.inverter_drop) = (LockMonitorState::default(), InverterDropState::default());
        s.seen.rotor_count = match self.c.source {
            AngleSource::Encoder => encoder,
            AngleSource::Injection => s.count_by_flux(),
        };
        self.c.motion.start(&mut s.motion, s.seen.rotor_count);
        if let Some(home) = self.home {
            s.motion.origin = home;
            let here = self.c.motion.turns(&s.motion, s.seen.rotor_count);
            s.references.turns.get_or_insert(here);
        }
        self.enter(State::Magnetising);
    }

    /// The current while the flux is built up, and while the saliency is checked, A.
    #[cold]
    pub(super) fn magnetise(&mut self) -> Result<Dq, Fault> {
        let s = &mut self.control;
        let r = &mut s.references;
        let level = self.c.inverter_drop.level(self.elapsed);
        let magnetising = Dq { d: level * r.current.d, q: 0.0 };
        let phase =
            match (self.elapsed.checked_sub(self.c.sequence.magnetise), self.c.saliency_check) {
                (None, _) => return Ok(magnetising),
                (Some(_), None) => SaliencyCheckAction::Passed,
                (Some(n), Some(check)) => {
                    check.step(&mut s.saliency_check, n, s.estimator.saliency().q)
                }
            };
        match phase {
            SaliencyCheckAction::Look => {
                r.injection_axis = SaliencyCheck::LOOK_AXIS;
                return Ok(Dq::ZERO);
            }
            SaliencyCheckAction::Restore => {
                r.injection_axis = self.c.injection_axis;
            }
            SaliencyCheckAction::Passed => {
                let watched = self.c.lock_monitor.is_some() && self.mode != Mode::Learning;
                self.enter(if watched { State::Verifying } else { State::of_mode(self.mode) });
            }
            // A drive that learns judges the slope.
            SaliencyCheckAction::Failed if self.mode == Mode::Learning => {
                r.injection_axis = self.c.injection_axis;
            }
            SaliencyCheckAction::Failed => return Err(Fault::NoSaliency),
        }
        Ok(magnetising)
    }

    /// The current while the lock is verified, A: the axis is tracked for a while without torque.
    #[cold]
    pub(super) fn verify(&mut self) -> Result<Dq, Fault> {
        if self.elapsed >= self.c.sequence.verify {
            if !self.stands() {
                return Err(Fault::LostLock);
            }
            self.enter(State::of_mode(self.mode));
        }
        Ok(Dq { d: self.control.references.current.d, q: 0.0 })
    }

    /// Whether the shaft stands, as far as the angle tells; NaN is no standstill.
    pub(super) fn stands(&self) -> bool {
        self.rotor_freq().abs() <= STANDING_FREQ
    }
}
