//! Flying start: start on a rotating shaft.

use core::f32::consts::TAU;

use super::{Common, Field, FluxPhase};
use crate::current::pi::ReferenceState;
use crate::flux::catch::{self, SearchResult};
use crate::flux::hand_over::HandOver;
use crate::flux::indirect::IndirectState;
use crate::math::within;
use crate::protect::lock_monitor::LockMonitorState;
use crate::{Coefficients, Dq, Fault, FlyingStart, PERIOD_S};

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

    /// Whether some of the flux may be left.
    pub fn is_recent(&self, c: &Coefficients) -> bool {
        c.flying_start.is_some_and(|start| self.ago < start.flux_decay)
    }

    /// Whether the flux would still drive too much current `elapsed` periods later.
    pub fn waits(&self, c: &Coefficients, elapsed: u32) -> bool {
        let Some(start) = &c.flying_start else { return false };
        let x = self.ago.saturating_add(elapsed) as f32 * start.decay;
        // The flux decays by e^x, which is more than this series.
        self.volts > start.residual_v * (1.0 + x * (1.0 + 0.5 * x))
    }
}

impl Field {
    /// Returns the current during the search for a rotating shaft, A.
    ///
    /// # Errors
    /// [`Fault::NotCaught`] if the shaft rotates too fast.
    #[cold]
    pub(super) fn search(&mut self, c: &Coefficients, k: &mut Common) -> Result<Dq, Fault> {
        let (Some(start), FluxPhase::Search(search)) = (&c.flying_start, &mut self.flux) else {
            self.continue_at_standstill(c, k, 0);
            return Ok(Dq::ZERO);
        };
        // At first there is no current, so that the bootstrap capacitors charge and a residual flux is not short-circuited.
        let Some(n) = k.elapsed.checked_sub(c.sequence.precharge) else {
            return Ok(Dq::ZERO);
        };
        let drives = self.carried.residual.is_some_and(|flux| flux.volts > NEGLIGIBLE_EMF_V);
        if n == 0 && !drives {
            self.reference[0] = ReferenceState::at_rest(INITIAL_SHARE * start.current);
        }
        let d = if drives { FlyingStart::WITH_FLUX * start.current } else { start.current };
        if n > catch::FROM {
            c.current_loop.freeze_integrator(&mut self.current_loop);
        }
        match search.step(n, self.observer.change) {
            SearchResult::Searching => {}
            SearchResult::Standing => {
                self.carried.residual = None;
                self.hand_over = HandOver::default();
                self.continue_at_standstill(c, k, 0);
            }
            SearchResult::Turning(flux_freq) => {
                let freq = start.path.rotor(flux_freq);
                if freq.abs() > HIGHEST {
                    return Err(Fault::NotCaught);
                }
                self.carried.residual = None;
                self.flux = FluxPhase::Build { from: k.elapsed };
                self.estimator.preset_speed(freq);
                self.indirect = IndirectState::default();
                self.observer.start(c.observer.as_ref());
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
    pub(super) fn build(&mut self, c: &Coefficients, k: &mut Common, n: u32) -> Result<Dq, Fault> {
        let most = k.limits.voltage.most.d;
        let missing = most - c.observer.as_ref().map_or(most, |o| o.magnetising(&self.observer));
        let (current, built) = c.flying_start.map_or((most, 0), |s| (s.current, s.build_up));
        let d = within(most + FORCING_GAIN * missing, (0.0, current));
        if n >= built {
            Fault::NotCaught.unless(c.prediction.sees_flux(&self.prediction))?;
            // At speed the injection current without torque does not predict the current under torque, so the baseline is measured
            // later.
            if self.hand_over.leads {
                self.lock = LockMonitorState::default();
            }
            // The loops continue from the present speed of the shaft.
            let speed = self.estimator.rotor_freq / c.freq_per_speed;
            c.motion.start(&mut self.motion, k.rotor_count);
            c.motion.take_over(&mut self.motion, k.rotor_count, speed, 0.0);
            self.enter(k, FluxPhase::ready());
        }
        Ok(Dq { d, q: 0.0 })
    }

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
