//! The torque that a drive tracks with the result of a learning.

use core::fmt;

use super::Settings;
use drive_core::learned::Learned;

/// Range of torque that a drive tracks with a [result](Learned).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tracked {
    /// Largest torque current, A, and torque, Nm; both signs.
    pub i_q: f32,
    /// See `i_q`.
    pub torque: f32,
    /// Direct current, A, and rotor flux L_m i_d, Wb peak.
    pub i_d: f32,
    /// See `i_d`.
    pub flux: f32,
    /// The reason of the limit of the torque current.
    pub limit: &'static str,
}

impl fmt::Display for Tracked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { i_q, torque, i_d, flux, limit } = self;
        write!(
            f,
            "trackable from -{torque:.2} to {torque:.2} Nm (-{i_q:.2} to {i_q:.2} A) at {flux:.3} Wb ({i_d:.2} A); the limit is {limit}"
        )
    }
}

impl Settings {
    /// Range of torque that a drive with these settings tracks with a result; `None` if it is not accepted, or has no slope.
    pub fn tracked(&self, learned: &Learned) -> Option<Tracked> {
        learned.slope.filter(|_| learned.verdict.is_accepted())?;
        let (i_d, motor) = (self.i_d(), &self.motor);
        let last = learned.reference.grid().current(learned.points);
        let lost = learned.limit_a < last;
        let i_q = learned.limit_a.min(self.i_q_limit_a());
        Some(Tracked {
            i_q,
            torque: i_q * motor.torque_per_ampere(i_d),
            i_d,
            flux: i_d * motor.l_m,
            limit: if lost { "the slope, which is lost beyond" } else { "the current limit" },
        })
    }
}
