//! Start on a turning shaft.

use core::f32::consts::TAU;

use super::Drive;
use crate::current::pi::ReferenceState;
use crate::drive::state::{Mode, State};
use crate::fault::Fault;
use crate::flux::catch::{self, CatchState, Caught, Path};
use crate::flux::hand_over::HandOver;
use crate::flux::indirect::IndirectState;
use crate::io::{PERIOD_S, periods};
use crate::math::frames::Dq;
use crate::math::within;
use crate::settings::Settings;

/// Current that the rotor is looked for with, as a share of the current limit.
const SHARE: f32 = 0.714;
/// Share of it that does not wait for the reference filter: the faster the current comes, the larger the flux that turns with the
/// rotor.
const AT_ONCE: f32 = 0.5;
/// Share of that current that is enough where flux was left: the flux drives a current of its own.
const WITH_FLUX: f32 = 0.4;
/// Voltage of flux that was left which drives no current to speak of, V.
const LITTLE_V: f32 = 1.0;
/// Share of the current that trips up to which both together may come.
const UP_TO: f32 = 0.7;
/// Current per missing magnetising current.
const FORCED: f32 = 10.0;
/// Time in which the flux of a turning rotor builds up, and until then the injection alone corrects the angle, s.
const BUILT_S: f32 = 0.35;
const ALONE_S: f32 = 0.2;
/// Highest frequency of a rotor that is caught, electrical turns per period: 2700 rpm of four poles, with the error of the
/// search. Above it the voltage of the rotor drowns in the noise of the sensors.
const HIGHEST: f32 = 91.0 * PERIOD_S;
/// Rotor time constants after which no flux is left in a motor that was switched off.
const FLUX_GONE_T: f32 = 4.0;

/// Coefficients of a start on a turning shaft, control periods and A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Catching {
    pub current: f32,
    pub alone: u32,
    pub built: u32,
    pub flux_gone: u32,
    pub path: Path,
    /// Largest voltage of flux that was left, V, and its decay per period.
    left_v: f32,
    decay: f32,
}

impl Settings {
    /// The start on a turning shaft, where the observer can follow it.
    pub(crate) fn catching(&self, k_c: [f32; 2]) -> Option<Catching> {
        let (tau_r, i_d) = (self.motor.tau_r(), self.i_d());
        let current = f32::max(SHARE * self.current_limit_a(), i_d);
        let path = Path::new(&self.motor, 0.5 * (k_c[0] + k_c[1]));
        (self.uses_observer() && self.sequence.catch).then(|| Catching {
            current,
            alone: periods(ALONE_S),
            built: periods(BUILT_S),
            flux_gone: periods(FLUX_GONE_T * tau_r),
            path,
            left_v: path.resistance * (UP_TO * self.trip_a() - WITH_FLUX * current),
            decay: PERIOD_S / tau_r,
        })
    }
}

/// State of such a start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CatchingState {
    search: CatchState,
    /// Period in which the speed was found; until then the frame stands, and nothing is judged.
    pub found: Option<u32>,
    /// Flux from a run before, until the search has ended.
    pub flux_left: Option<FluxLeft>,
}

/// Flux of a run before.
#[derive(Clone, Copy, Debug)]
pub(super) struct FluxLeft {
    /// Voltage that it induced when that run ended, V.
    pub volts: f32,
    /// Control periods from then to this start.
    pub ago: u32,
}

impl Drive {
    /// The flux that a run left which has ended lately.
    pub(super) fn flux_left(&self) -> Option<FluxLeft> {
        let (s, ago) = (&self.control, self.elapsed);
        let freq = s.estimator.rotor_freq.abs() * (TAU / PERIOD_S);
        let left = match s.catching.flux_left {
            // A start that found no speed knows no more than this.
            Some(left) => FluxLeft { ago: left.ago + ago, ..left },
            None if self.mode == Mode::VoltsPerHertz => {
                FluxLeft { volts: s.seen.voltage.q.abs(), ago }
            }
            None => FluxLeft { volts: freq * s.observer.flux, ago },
        };
        let recent = self.c.catching.is_some_and(|c| left.ago < c.flux_gone);
        (self.starts > 0 && recent).then_some(left)
    }

    /// Whether flux that was left would drive too much current yet.
    pub(super) fn waits_for_flux(&self) -> bool {
        let Some((c, left)) = self.c.catching.zip(self.control.catching.flux_left) else {
            return false;
        };
        let x = (left.ago + self.elapsed) as f32 * c.decay;
        // It decays by e^x, which is more than this.
        left.volts > c.left_v * (1.0 + x * (1.0 + 0.5 * x))
    }

    pub(super) fn catch_from_here(&mut self) {
        self.control.hand_over.silence();
        self.enter(State::Catching);
    }

    /// The current while a turning shaft is looked for and magnetised, A.
    ///
    /// # Errors
    /// [`Fault::NotCaught`] for a shaft that turns too fast.
    #[cold]
    pub(super) fn catch(&mut self) -> Result<Dq, Fault> {
        let Some(c) = self.c.catching else {
            self.magnetising_from_here(0);
            return Ok(Dq::ZERO);
        };
        let (s, elapsed) = (&mut self.control, self.elapsed);
        let Some(found) = s.catching.found else {
            // Without current first: the bootstrap capacitors charge, and what flux there is meets no short circuit.
            let Some(n) = elapsed.checked_sub(self.c.sequence.precharge) else {
                return Ok(Dq::ZERO);
            };
            let drives = s.catching.flux_left.is_some_and(|left| left.volts > LITTLE_V);
            if n == 0 && !drives {
                s.reference[0] = ReferenceState::at_rest(AT_ONCE * c.current);
            }
            let d = if drives { WITH_FLUX * c.current } else { c.current };
            if n > catch::FROM {
                self.c.current_loop.hold(&mut s.current_loop);
            }
            match s.catching.search.step(n, s.observer.change) {
                Caught::Searching => {}
                Caught::Standing => {
                    s.catching.flux_left = None;
                    s.hand_over = HandOver::default();
                    self.magnetising_from_here(0);
                }
                Caught::Turning(flux_freq) => {
                    let freq = c.path.rotor(flux_freq);
                    if freq.abs() > HIGHEST {
                        return Err(Fault::NotCaught);
                    }
                    s.catching.found = Some(elapsed);
                    s.catching.flux_left = None;
                    s.estimator.turn_with(freq);
                    s.indirect = IndirectState::default();
                    if let Some(observer) = &self.c.observer {
                        observer.start(&mut s.observer);
                    }
                }
            }
            return Ok(Dq { d, q: 0.0 });
        };
        // As much flux as the voltage bears, and with all current until it has built up.
        let most = s.voltage_limit.most.d;
        let missing = most - self.c.observer.as_ref().map_or(most, |o| o.magnetising(&s.observer));
        let d = within(most + FORCED * missing, (0.0, c.current));
        if elapsed.wrapping_sub(found) >= c.built {
            self.c.motion.start(&mut s.motion, s.seen.rotor_count);
            self.enter(State::of_mode(self.mode));
        }
        Ok(Dq { d, q: 0.0 })
    }

    /// The state to go to when the start on a turning shaft ends so: a wrong speed shows as a voltage or a current that it does
    /// not explain.
    #[cold]
    pub(super) fn why_not_caught(&self, off: State) -> State {
        use Fault::{CurrentNotAsPredicted, FluxNotAsPredicted, LostLock, NotCaught};
        match off {
            State::Fault(CurrentNotAsPredicted | FluxNotAsPredicted | LostLock)
                if self.state == State::Catching =>
            {
                NotCaught.into()
            }
            _ => off,
        }
    }
}
