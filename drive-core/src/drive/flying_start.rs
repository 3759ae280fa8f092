//! Flying start: start on a rotating shaft.

use core::f32::consts::TAU;

use super::{Common, Field, FluxPhase, Start};
use crate::blocks::Catch;
use crate::current::pi::ReferenceState;
use crate::flux::catch::{self, CatchState, FlyingStart, Origin, SearchResult, Try};
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
/// Highest frequency of a rotor that the fixed frame shows, electrical turns per period: 2700 rpm of four poles, with the error of the
/// search. Above it the voltage of the rotor is smaller than the noise of the sensors.
const HIGHEST: f32 = 91.0 * PERIOD_S;
/// Lowest frequency of a rotor that is found in a rotating frame, electrical turns per period.
const ROTATES: f32 = 3.0 * PERIOD_S;
/// Share of [`HIGHEST`] below which the fixed frame is left to find a rotor of unknown speed.
const LEAST_SHARE: f32 = 0.9;
/// Number of times that a rotating frame follows the speed found in it.
const STEPS: u8 = 5;

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
        let (at, turns) = (search.at, search.at.freq != 0.0);
        let brief = at.from == Origin::Brief && !turns;
        let drives = s.carried.residual.is_some_and(|flux| flux.volts > NEGLIGIBLE_EMF_V);
        let current = if turns || brief { start.search_current } else { start.current };
        if n == 0 {
            if !drives {
                s.reference[0] = ReferenceState::at_rest(INITIAL_SHARE * current);
            }
            s.estimator.preset_speed(at.freq);
        }
        let d = match (turns, drives) {
            (_, false) => current,
            // In the frame that rotates with it, a residual flux shows its speed without current.
            (true, true) => 0.0,
            // A larger one would add to the current of the residual flux.
            (false, true) => start.search_current,
        };
        let wanted = Dq { d, q: 0.0 };
        if n > catch::FROM && !turns {
            self.current_loop.freeze_integrator(&mut s.current_loop);
        }
        let end = if brief { catch::BRIEF } else { start.search[usize::from(turns)] };
        if turns {
            search.settle(n, end, s.observer.change, k.seen.current);
        }
        let flux = match search.step(n, end, s.observer.change) {
            SearchResult::Searching => return Ok(wanted),
            SearchResult::Standing if brief => return self.search_on(s, k).map(|()| wanted),
            SearchResult::Standing if !turns => {
                s.carried.residual = None;
                s.hand_over = HandOver::default();
                self.continue_at_standstill(s, k, 0);
                return Ok(wanted);
            }
            SearchResult::Standing => 0.0,
            SearchResult::Turning(freq) => freq,
        };
        let slip = search.slip(&start.path);
        let (rotor, is_found) = match (turns, drives) {
            (false, _) => {
                let rotor = start.path.rotor(flux);
                (rotor, rotor.abs() < HIGHEST)
            }
            // The next frame has the speed of the residual flux, and then shows the slip.
            (true, true) => (at.freq + flux, false),
            (true, false) => (at.freq - slip, slip.abs() < start.near),
        };
        // A frame in the other sense than the rotor shows a slow one. So a slow rotor of unknown speed is left to the fixed frame.
        let known = matches!(at.from, Origin::Run | Origin::Brief);
        let least = if known { ROTATES } else { LEAST_SHARE * HIGHEST };
        let (ahead, most) = (if at.freq < 0.0 { -rotor } else { rotor }, at.freq.abs());
        let established = if turns { start.injection_only } else { 0 };
        if turns {
            // From here on the frame lies along the flux.
            s.estimator.axis.angle += search.lead();
            // A frame that is much faster than the rotor shows its speed only roughly, so the next frame rotates with that speed.
            if !is_found && (least..2.0 * most).contains(&ahead) && at.steps < STEPS {
                s.carried.residual = None;
                self.search_in(s, k, Try { freq: rotor, steps: at.steps + 1, ..at });
                return Ok(wanted);
            }
        }
        if brief && is_found && (ROTATES..self.protection.rotor_freq).contains(&rotor.abs()) {
            // The frame that rotates with the shaft hardly brakes it.
            s.carried.residual = None;
            self.search_in(s, k, Try { freq: rotor, ..at });
            return Ok(wanted);
        }
        if brief || !is_found || (turns && ahead < least) {
            return self.search_on(s, k).map(|()| wanted);
        }
        let flux = search.flux();
        s.carried.residual = None;
        s.flux = FluxPhase::Build { from: k.elapsed.wrapping_sub(established), at };
        s.estimator.preset_speed(rotor);
        s.indirect = IndirectState::default();
        s.observer.start(self.observer.as_ref());
        if turns {
            s.observer.flux = flux;
        }
        Ok(Dq { d, q: 0.0 })
    }

    /// Begins the search for a rotating shaft.
    #[cold]
    pub(super) fn begin_search(&self, s: &mut Field<L::State>, built: Catch) {
        s.hand_over.switch_carrier_off();
        let fastest = self.flying_start.map_or(0.0, |start| start.fastest);
        let (from, freq) = match s.carried.rotor_freq {
            Some(freq) if freq.abs() > ROTATES => (Origin::Run, freq),
            None if fastest > 0.0 => (Origin::Forward, fastest),
            None => (Origin::Brief, 0.0),
            _ => (Origin::Fixed, 0.0),
        };
        s.flux = FluxPhase::Search(CatchState::new(Try { _built: built, from, freq, steps: 0 }));
    }

    /// Continues the search in this frame.
    #[cold]
    fn search_in(&self, s: &mut Field<L::State>, k: &mut Common, at: Try) {
        k.elapsed = self.sequence.precharge;
        s.estimator.preset_speed(at.freq);
        s.hand_over = HandOver::default();
        s.hand_over.switch_carrier_off();
        s.flux = FluxPhase::Search(CatchState::new(at));
    }

    /// Begins the search in the next frame.
    ///
    /// # Errors
    /// [`Fault::NotCaught`] if the shaft was found in no frame.
    #[cold]
    fn search_on(&self, s: &mut Field<L::State>, k: &mut Common) -> Result<(), Fault> {
        let last = match &s.flux {
            FluxPhase::Search(search) => search.at,
            FluxPhase::Build { at, .. } => *at,
            _ => return Ok(()),
        };
        let fastest = self.flying_start.map_or(0.0, |start| start.fastest);
        let (from, freq) = match last.from {
            Origin::Run if fastest > 0.0 => (Origin::Forward, fastest),
            Origin::Forward => (Origin::Backward, -fastest),
            Origin::Run | Origin::Backward => (Origin::Brief, 0.0),
            Origin::Brief => (Origin::Fixed, 0.0),
            Origin::Fixed => return Err(Fault::NotCaught),
        };
        self.estimator.start(&mut s.estimator);
        self.search_in(s, k, Try { from, freq, steps: 0, ..last });
        Ok(())
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
        if n >= built && !self.prediction.sees_flux(&s.prediction) {
            self.search_on(s, k)?;
        } else if n >= built {
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
