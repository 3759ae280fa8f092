//! Start on a turning shaft.

use core::f32::consts::TAU;

use super::Kept;
use super::field::{Field, FluxPhase};
use crate::current::pi::ReferenceState;
use crate::drive::coefficients::Coefficients;
use crate::fault::Fault;
use crate::flux::catch::{self, Caught, Path};
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

/// Flux of a run before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Residual {
    /// Voltage that it induced when that run ended, V.
    volts: f32,
    /// Control periods since then, of those that count.
    ago: u32,
}

impl Residual {
    /// Flux that induces this voltage now, V.
    pub fn of(volts: f32) -> Self {
        Self { volts, ago: 0 }
    }

    /// Flux of a rotor that turns with `freq`, electrical turns per period.
    pub fn turning(freq: f32, flux: f32) -> Self {
        Self::of(freq.abs() * (TAU / PERIOD_S) * flux)
    }

    /// The same so many periods later.
    pub fn after(self, periods: u32) -> Self {
        Self { ago: self.ago.saturating_add(periods), ..self }
    }

    /// Whether there may be some of it left.
    pub fn is_recent(&self, c: &Coefficients) -> bool {
        c.catching.is_some_and(|catching| self.ago < catching.flux_gone)
    }

    /// Whether it would drive too much current yet, `elapsed` periods later.
    pub fn waits(&self, c: &Coefficients, elapsed: u32) -> bool {
        let Some(catching) = &c.catching else { return false };
        let x = self.ago.saturating_add(elapsed) as f32 * catching.decay;
        // It decays by e^x, which is more than this.
        self.volts > catching.left_v * (1.0 + x * (1.0 + 0.5 * x))
    }
}

impl Field {
    /// The current while a turning shaft is looked for, A.
    ///
    /// # Errors
    /// [`Fault::NotCaught`] for a shaft that turns too fast.
    #[cold]
    pub(super) fn search(&mut self, c: &Coefficients, k: &mut Kept) -> Result<Dq, Fault> {
        let (Some(catching), FluxPhase::Search(search)) = (&c.catching, &mut self.flux) else {
            self.hold(c, k, 0);
            return Ok(Dq::ZERO);
        };
        // Without current first: the bootstrap capacitors charge, and what flux there is meets no short circuit.
        let Some(n) = k.elapsed.checked_sub(c.sequence.precharge) else {
            return Ok(Dq::ZERO);
        };
        let drives = self.residual.is_some_and(|residual| residual.volts > LITTLE_V);
        if n == 0 && !drives {
            self.reference[0] = ReferenceState::at_rest(AT_ONCE * catching.current);
        }
        let d = if drives { WITH_FLUX * catching.current } else { catching.current };
        if n > catch::FROM {
            c.current_loop.hold(&mut self.current_loop);
        }
        match search.step(n, self.observer.change) {
            Caught::Searching => {}
            Caught::Standing => {
                self.residual = None;
                self.hand_over = HandOver::default();
                self.hold(c, k, 0);
            }
            Caught::Turning(flux_freq) => {
                let freq = catching.path.rotor(flux_freq);
                if freq.abs() > HIGHEST {
                    return Err(Fault::NotCaught);
                }
                self.residual = None;
                self.flux = FluxPhase::Build { from: k.elapsed };
                self.estimator.turn_with(freq);
                self.indirect = IndirectState::default();
                if let Some(observer) = &c.observer {
                    observer.start(&mut self.observer);
                }
            }
        }
        Ok(Dq { d, q: 0.0 })
    }

    /// The current while the flux of a turning rotor builds up, from period `from` on: as much flux as the voltage bears,
    /// and with all current until it has built up.
    #[cold]
    pub(super) fn build(&mut self, c: &Coefficients, k: &mut Kept, from: u32) -> Dq {
        let most = k.limits.voltage.most.d;
        let missing = most - c.observer.as_ref().map_or(most, |o| o.magnetising(&self.observer));
        let (current, built) =
            c.catching.map_or((most, 0), |catching| (catching.current, catching.built));
        let d = within(most + FORCED * missing, (0.0, current));
        if k.elapsed.wrapping_sub(from) >= built {
            c.motion.start(&mut self.motion, k.rotor_count);
            self.enter(k, FluxPhase::Ready);
        }
        Dq { d, q: 0.0 }
    }

    /// The fault of a drive that ends with this one: where a turning shaft is looked for or magnetised, a wrong speed shows as a
    /// voltage or a current that it does not explain.
    #[cold]
    pub(super) fn why_not_caught(&self, fault: Fault) -> Fault {
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
