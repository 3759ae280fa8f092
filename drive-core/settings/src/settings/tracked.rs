//! Torque range in which a drive tracks the angle with a learned result.

use core::fmt;

use super::Settings;
use drive_core::learned::Learned;

impl Settings {
    /// Returns a text with the range of torque, Nm, and of q-axis current, A peak, in which a drive with these settings and a learned
    /// result tracks the angle. The text also contains the share of the rated torque, the rotor flux L_m i_d, Wb peak, its d-axis
    /// current, A, and the limiting factor: the saliency sensitivity, if it is too small beyond; the range of the sensors, with the
    /// range that would not limit; or the current limit. `None` if the result is not accepted, or has no saliency sensitivity.
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
                _ if lost => f.write_str("the saliency sensitivity, too small beyond"),
                Some((a, pct)) => {
                    write!(f, "the range of the sensors: {a:.1} A would allow {pct:.0} %")
                }
                None => f.write_str("the current limit"),
            }
        }))
    }
}
