//! The torque that a drive tracks with the result of a learning.

use core::fmt;

use super::Settings;
use drive_core::learned::Learned;

impl Settings {
    /// Range of torque, Nm, and of torque current, A peak, that a drive with these settings tracks with a result, and what limits
    /// it, in words: the slope, where it is lost beyond, the range of the sensors with the one that would not bind, or the current
    /// limit; with the share of the rated torque, the rotor flux L_m i_d, Wb peak, and its direct current, A. `None` if the result is
    /// not accepted, or has no slope.
    pub fn tracked(&self, learned: &Learned) -> Option<impl fmt::Display + use<>> {
        learned.slope.filter(|_| learned.verdict.is_accepted())?;
        let (i_d, i_q) = (self.i_d(), learned.limit_a.min(self.i_q_limit_a()));
        let (torque, flux) = (i_q * self.motor.torque_per_ampere(i_d), i_d * self.motor.l_m);
        let lost = learned.limit_a < learned.reference.grid().current(learned.points);
        let (pct, better) = (100.0 * torque / self.nameplate.torque_nm(), self.better_sensors());
        Some(fmt::from_fn(move |f| {
            write!(
                f,
                "trackable from -{torque:.2} to {torque:.2} Nm ({pct:.0} % of rated, -{i_q:.2} to {i_q:.2} A) at {flux:.3} Wb ({i_d:.2} A); \
                 the limit is "
            )?;
            match better {
                _ if lost => f.write_str("the slope, which is lost beyond"),
                Some((a, pct)) => {
                    write!(f, "the range of the sensors: {a:.1} A would allow {pct:.0} %")
                }
                None => f.write_str("the current limit"),
            }
        }))
    }
}
