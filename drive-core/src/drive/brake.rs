//! Control of a motor with a mechanical brake, for example of a hoist. The brake opens only after the torque was proven, and the torque
//! ends only after the brake has closed.
//!
//! The firmware opens the brake while the drive regulates, and closes it when the drive stops; see `src/terminals.rs`.

use super::{Common, Field, FluxPhase, Goal};
use crate::{AngleLoop, Coefficients, Dq, Fault};

/// Longest time that a brake may need to close, s.
pub const BRAKE_MAX_S: f32 = 5.0;
/// Q-axis current of the proof, as a share of the largest one.
const PROOF_SHARE: f32 = 0.25;
/// Periods of the proof: 0.1 s, several settling times of the current.
const PROOF: u32 = 600;
/// Share of that current by which the measured current may deviate.
const PROOF_ERROR: f32 = 0.3;

impl Common {
    /// Returns the phase that follows when the flux was built up and verified.
    pub(super) fn behind_the_flux(&self) -> FluxPhase {
        if self.brake > 0 { FluxPhase::Prove } else { FluxPhase::ready() }
    }

    /// Returns the goal for a shaft that has come to rest.
    pub(super) fn at_rest(&self) -> Goal {
        if self.brake > 0 { Goal::Hold { left: self.brake } } else { Goal::Release }
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Returns the current while the torque is proven, A. The brake is closed, and the q-axis current must follow its reference.
    ///
    /// # Errors
    /// [`Fault::TorqueNotProven`].
    #[cold]
    pub(super) fn prove(&self, s: &mut Field<L::State>, k: &mut Common) -> Result<Dq, Fault> {
        let wanted = PROOF_SHARE * self.protection.i_q;
        if k.elapsed >= PROOF {
            let missing = (wanted - k.seen.current.q).abs();
            Fault::TorqueNotProven.unless(missing <= PROOF_ERROR * wanted)?;
            s.enter(k, FluxPhase::ready());
        }
        Ok(Dq { d: k.references.current.d, q: wanted })
    }
}
