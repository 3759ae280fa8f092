//! Excitation of a motor at rest for the [commissioning](crate::commission).
//!
//! The current along phase a is regulated by one controller, with an optional carrier; the voltage across it is the
//! carrier alone, without control. The dead time is not compensated: the commissioning measures it.

use super::Drive;
use crate::carrier::injection::{CARRIER_COS, CARRIER_SAMPLES};
use crate::current::pi::{Pi, PiState, ReferenceFilter, ReferenceState};
use crate::current::sensing::Measured;
use crate::drive::command::{Accepted, Refused};
use crate::drive::excitation::{Excitation, Excited, Regulator};
use crate::drive::state::{Mode, State};
use crate::fault::Fault;
use crate::filter::dissertation::LPF;
use crate::io::Compare;
use crate::math::frames::{Abc, AlphaBeta, Dq};
use crate::math::limited;
use crate::protect::wiring_check::{WiringCheck, WiringCheckState};

/// Control periods in which the carrier rises to its amplitude: twenty of its own.
const RAMP: f32 = 20.0 * CARRIER_SAMPLES as f32;

/// State of the excitation.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ExcitationState {
    wanted: Excitation,
    regulator: PiState,
    reference: ReferenceState,
    /// Present amplitude of the carrier, V.
    carrier: AlphaBeta,
    /// Sample within the period of the carrier.
    index: usize,
    /// Register of the binary sequence; zero before its first sample.
    register: u8,
    /// Pulse trains that have ended.
    trains: u32,
}

/// The next sample, plus or minus one, of the sequence of largest length by x^8 + x^6 + x^5 + x^4 + 1.
fn next_bit(register: &mut u8) -> f32 {
    let r = if *register == 0 { 1 } else { *register };
    *register = (r << 1) | ((r >> 7 ^ r >> 5 ^ r >> 4 ^ r >> 3) & 1);
    if r & 1 == 1 { 1.0 } else { -1.0 }
}

impl Drive {
    /// Whether [`Collector`](crate::commission::Collector) is to be given what the last step saw.
    pub fn excites(&self) -> bool {
        self.state == State::Exciting
    }

    /// What the commissioning needs of this drive.
    pub fn excited(&self) -> Excited {
        Excited {
            state: self.state,
            starts: self.starts,
            offsets: self.c.sensing.offsets(&self.control.sensing),
            trains: self.control.excitation.trains,
            answers: self.wiring.answers(),
        }
    }

    /// Takes [`Command::Excite`](super::Command::Excite).
    pub(super) fn take_excitation(&mut self, wanted: Excitation) -> Result<Accepted, Refused> {
        if let Excitation::Current { amperes, regulator, carrier, .. } = wanted {
            let (max, sum) = (self.c.protection.trip_a, amperes + carrier.alpha + carrier.beta);
            if !(sum + regulator.k_c + regulator.z_c + regulator.direct).is_finite() {
                return Err(Refused::NotFinite);
            }
            if amperes.abs() > max {
                return Err(Refused::OutOfRange { min: -max, max });
            }
        }
        if self.excites() {
            self.control.excitation.wanted = wanted;
            self.excite_from_here();
        } else {
            self.start(Mode::Commissioning)?;
            self.control.excitation.wanted = wanted;
        }
        Ok(Accepted::AsGiven)
    }

    /// Begins the wanted excitation.
    pub(super) fn excite_from_here(&mut self) {
        let pulses = matches!(self.control.excitation.wanted, Excitation::Pulses(_));
        if pulses {
            self.wiring = WiringCheckState::default();
        }
        self.enter(if pulses { State::CheckingWiring } else { State::Exciting });
    }

    /// The pulses in force: of the commissioning, or of a start.
    pub(super) fn pulses(&self) -> WiringCheck {
        match &self.control.excitation.wanted {
            Excitation::Pulses(pulses) => WiringCheck::new(pulses),
            _ => self.c.wiring,
        }
    }

    /// Rests after a pulse train.
    pub(super) fn end_train(&mut self) {
        let s = &mut self.control.excitation;
        *s = ExcitationState { trains: s.trains.wrapping_add(1), ..ExcitationState::default() };
        self.enter(State::Exciting);
    }

    /// A step of the excitation.
    #[cold]
    pub(super) fn excite(&mut self, measured: &Measured) -> Result<Compare, Fault> {
        let s = &mut self.control.excitation;
        let mut realised = AlphaBeta::ZERO;
        let mut compare = Compare::LOW_SIDES_ON;
        let filtered = LPF.step(&mut self.control.low_pass, measured.current);
        if let Excitation::Current { amperes, regulator, carrier, binary } = s.wanted {
            let Regulator { k_c, z_c, direct, filtered: is_filtered } = regulator;
            let filter = ReferenceFilter { one_minus_p: 1.0 - z_c, direct };
            let reference = filter.step(&mut s.reference, amperes);
            let current = if is_filtered { filtered } else { measured.current };
            let along = Pi { k_c, z_c }.step(&mut s.regulator, reference - current.alpha);
            let largest = (carrier.alpha.abs() + carrier.beta.abs() + 1.0) * (1.0 / RAMP);
            s.carrier.alpha += limited(carrier.alpha - s.carrier.alpha, largest);
            s.carrier.beta += limited(carrier.beta - s.carrier.beta, largest);
            let cos = CARRIER_COS.get(s.index).copied().unwrap_or(0.0);
            s.index = if s.index + 1 < CARRIER_SAMPLES { s.index + 1 } else { 0 };
            let factor = if binary { next_bit(&mut s.register) } else { cos };
            let wanted = AlphaBeta::new(along, 0.0) + s.carrier * factor;
            if !(wanted.alpha + wanted.beta).is_finite() {
                return Err(self.not_finite().unwrap_or(Fault::NonFiniteState));
            }
            let modulated = self.c.modulator.step(wanted, Abc::ZERO, measured.dc_link);
            if modulated.limited {
                s.regulator.back_calculate(modulated.realised.alpha - wanted.alpha);
            }
            realised = modulated.realised;
            compare = Compare::on(modulated.compare);
        }
        let seen = &mut self.control.seen;
        (seen.measured, seen.realised) = (measured.current, realised);
        seen.dc_link = measured.dc_link;
        // For the thermal loads.
        seen.current = Dq::new(measured.current.alpha, measured.current.beta);
        Ok(compare)
    }
}
