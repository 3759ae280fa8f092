//! Flying start: start on a rotating shaft.

use core::f32::consts::TAU;

use super::{Common, Field, FluxPhase, Start};
use crate::current::pi::ReferenceState;
use crate::flux::catch::{self, FlyingStart, SearchResult};
use crate::flux::hand_over::HandOver;
use crate::flux::indirect::IndirectState;
use crate::math::within;
use crate::protect::lock_monitor::LockMonitorState;
use crate::{AngleLoop, Coefficients, Dq, Fault, PERIOD_S};

/// Share of the search current that bypasses the reference filter. The faster the current rises, the larger is the flux that rotates with
/// the rotor.
const INITIAL_SHARE: f32 = 0.5;
/// Voltage of a residual flux that drives only a negligible current, V.
const NEGLIGIBLE_EMF_V: f32 = 1.0;
/// Forcing current per missing magnetising current.
const FORCING_GAIN: f32 = 10.0;
/// Highest frequency of a rotor for a flying start, electrical turns per period: 2700 rpm of four poles, with the error of
/// the search. Above it the voltage of the rotor is smaller than the noise of the sensors.
const HIGHEST: f32 = 91.0 * PERIOD_S;

/// Residual flux of the run before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Residual {
    /// Voltage that the flux induced when that run ended, V.
    volts: f32,
    /// Control periods since then, as far as they are counted.
    ago: u32,
}

impl Residual {
    /// Returns a flux that induces this voltage now, V.
    pub fn of(volts: f32) -> Self {
        Self { volts, ago: 0 }
    }

    /// Returns the `flux` of a rotor that rotates at `freq`, electrical turns per period.
    pub fn turning(freq: f32, flux: f32) -> Self {
        Self::of(freq.abs() * (TAU / PERIOD_S) * flux)
    }

    /// Returns the residual flux so many periods later.
    pub fn after(self, periods: u32) -> Self {
        Self { ago: self.ago.saturating_add(periods), ..self }
    }
}

impl FlyingStart {
    /// Whether some of a residual flux may be left.
    pub(super) fn is_recent(&self, residual: &Residual) -> bool {
        residual.ago < self.flux_decay
    }

    /// Whether a residual flux would still drive too much current `elapsed` periods later.
    pub(super) fn waits(&self, residual: &Residual, elapsed: u32) -> bool {
        let x = residual.ago.saturating_add(elapsed) as f32 * self.decay;
        // The flux decays by e^x, which is more than this series.
        residual.volts > self.residual_v * (1.0 + x * (1.0 + 0.5 * x))
    }
}

impl<S> Field<S> {
    /// Returns the fault to be reported for this one. While a rotating shaft is searched or magnetised, a wrong speed shows as
    /// an unexplained voltage or current, which is reported as a failed flying start.
    #[cold]
    pub(super) fn as_catch_failure(&self, fault: Fault) -> Fault {
        use Fault::{CurrentNotAsPredicted, FluxNotAsPredicted, LostLock, NotCaught};
        match (fault, &self.flux) {
            (
                CurrentNotAsPredicted | FluxNotAsPredicted | LostLock,
                FluxPhase::Search(_) | FluxPhase::Build { .. },
            ) => NotCaught,
            _ => fault,
        }
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Returns the flying start with which this start begins. A drive that learns has a locked shaft.
    pub(super) fn catches(&self, start: &Start) -> Option<&FlyingStart> {
        let catches = matches!(start, Start::Field(goal) if goal.regulates());
        self.flying_start.as_ref().filter(|_| catches)
    }

    /// Returns the current during the search for a rotating shaft, A.
    ///
    /// # Errors
    /// [`Fault::NotCaught`] if the shaft rotates too fast.
    #[cold]
    pub(super) fn search_shaft(
        &self,
        s: &mut Field<L::State>,
        k: &mut Common,
    ) -> Result<Dq, Fault> {
        let (Some(start), FluxPhase::Search(search)) = (&self.flying_start, &mut s.flux) else {
            self.continue_at_standstill(s, k, 0);
            return Ok(Dq::ZERO);
        };
        // At first there is no current, so that the bootstrap capacitors charge and a residual flux is not short-circuited.
        let Some(n) = k.elapsed.checked_sub(self.sequence.precharge) else {
            return Ok(Dq::ZERO);
        };
        let drives = s.carried.residual.is_some_and(|flux| flux.volts > NEGLIGIBLE_EMF_V);
        if n == 0 && !drives {
            s.reference[0] = ReferenceState::at_rest(INITIAL_SHARE * start.current);
        }
        let d = if drives { FlyingStart::WITH_FLUX * start.current } else { start.current };
        if n > catch::FROM {
            self.current_loop.freeze_integrator(&mut s.current_loop);
        }
        match search.step(n, s.observer.change) {
            SearchResult::Searching => {}
            SearchResult::Standing => {
                s.carried.residual = None;
                s.hand_over = HandOver::default();
                self.continue_at_standstill(s, k, 0);
            }
            SearchResult::Turning(flux_freq) => {
                let freq = start.path.rotor(flux_freq);
                if freq.abs() > HIGHEST {
                    return Err(Fault::NotCaught);
                }
                s.carried.residual = None;
                s.flux = FluxPhase::Build { from: k.elapsed, _built: start.built };
                s.estimator.preset_speed(freq);
                s.indirect = IndirectState::default();
                s.observer.start(self.observer.as_ref());
            }
        }
        Ok(Dq { d, q: 0.0 })
    }

    /// Returns the current while the flux of a rotating rotor builds up, `n` periods after the beginning. The goal is as much
    /// flux as the voltage allows, with the full current until it has built up.
    ///
    /// # Errors
    /// [`Fault::NotCaught`] if no voltage shows the flux. In a frame that does not rotate with the rotor there is no flux.
    #[cold]
    pub(super) fn build_flux(
        &self,
        s: &mut Field<L::State>,
        k: &mut Common,
        n: u32,
    ) -> Result<Dq, Fault> {
        let most = k.limits.voltage.most.d;
        let missing = most - self.observer.as_ref().map_or(most, |o| o.magnetising(&s.observer));
        let (current, built) = self.flying_start.map_or((most, 0), |s| (s.current, s.build_up));
        let d = within(most + FORCING_GAIN * missing, (0.0, current));
        if n >= built {
            Fault::NotCaught.unless(self.prediction.sees_flux(&s.prediction))?;
            // At speed the injection current without torque does not predict the current under torque, so the baseline is measured
            // later.
            if s.hand_over.leads {
                s.lock = LockMonitorState::default();
            }
            // The loops continue from the present speed of the shaft.
            let speed = s.estimator.axis.rotor_freq / self.freq_per_speed;
            self.motion.start(&mut s.motion, k.rotor_count);
            self.motion.take_over(&mut s.motion, k.rotor_count, speed, 0.0);
            s.enter(k, FluxPhase::ready());
        }
        Ok(Dq { d, q: 0.0 })
    }
}
