//! Limits of the q-axis current by dc current and power, motoring and generating, computed once an injection period.
//!
//! Power that motor and switches take from the dc link, over 3/2, with `w` the electrical speed of the rotor, `i_m` the
//! magnetising current, `u` the inverter voltage error and `R_r' = (L_m/L_r)^2 r_r`:
//!
//! ```text
//! measured  p = v_d i_d + v_q i_q + 4/pi u |i|
//! model     p = a i_q^2 + b i_q + r_s i_d^2 + e      a = r_s + R_r',  b = w i_m L_m^2/L_r
//! error     e follows what the model leaves of the measured power, 30 ms
//! motoring  p <=  m    between the two roots
//! braking   p >= -g    outside of the two roots, on the side of no torque
//! ```
//!
//! The roots follow speed and flux at once, so the torque falls as the speed rises; `e` makes them exact at the limit. The
//! energy that the inductances exchange has no mean. The losses of the injection and of the iron are part of `e`.
//!
//! Torque is never reversed. A motoring limit below the losses leaves no motoring torque, but the d-axis current stays. Near
//! standstill the copper losses absorb the whole power of the shaft: at speeds at which no q-axis current feeds `g` into the
//! link, generating torque is not limited, and next to these speeds the limit rises again gradually. At least half of the
//! copper loss of the d-axis current counts as absorbed.

use core::f32::consts::FRAC_2_PI;

use super::{Coefficients, DcLimit, PowerLimit, Telemetry};
use crate::dc_link::{DIVIDER, DcLinkLimits, Limiting};
use crate::{AngleLoop, PERIOD_S};

/// Share of the newest value in the error of the model.
const ERROR_SHARE: f32 = DIVIDER as f32 * PERIOD_S / 0.03;
/// Gain with which the generating limit rises where the copper losses absorb all power. Generating torque is unlimited at about 0.7
/// of that speed.
const REOPENING: f32 = 10.0;

impl DcLimit {
    /// Returns the power at this voltage, over 3/2.
    fn at(&self, dc_link: f32) -> f32 {
        let by_current = self.current_a * dc_link;
        (2.0 / 3.0) * if by_current < self.power_w { by_current } else { self.power_w }
    }
}

impl PowerLimit {
    /// Narrows the `limits` of a drive with the coefficients `c` by the telemetry `seen` of the last step, with the magnetising
    /// current, A, and the inverter voltage error, V. `error` is the state.
    #[cold] // in the flash
    #[inline(never)]
    pub fn step<L: AngleLoop>(
        &self,
        c: &Coefficients<L>,
        error: &mut f32,
        limits: &mut DcLinkLimits,
        seen: &Telemetry,
        (magnetising, drop): (f32, f32),
    ) {
        let (r_s, a) = (c.voltage_limit.r_s, c.voltage_limit.r_s + c.inverter_drop.rotor);
        let (i, v, root) = (seen.current, seen.voltage, fpu_sqrt::sqrtf);
        let emf = c.voltage_limit.emf() * seen.rotor_freq * magnetising;
        let copper = r_s * i.d * i.d;
        let lost = 2.0 * FRAC_2_PI * drop * root(i.length_squared());
        let unexplained = v.d * i.d + v.q * i.q + lost - copper - (a * i.q + emf) * i.q;
        *error += ERROR_SHARE * (unexplained - *error);
        let losses = copper + *error;

        // The computation assumes a shaft that rotates forwards.
        let b = emf.abs();
        let room = (self.motoring.at(seen.dc_link) - losses).max(0.0);
        let both = root(b * b + 4.0 * a * room);
        let room = (self.generating.at(seen.dc_link) + losses).max(0.5 * copper);
        let left = b * b - 4.0 * a * room;
        let back = if left > 0.0 { b - root(left) } else { b - REOPENING * left / b.max(1e-3) };
        // Far beyond this point, the copper losses alone exceed a motoring limit.
        let back = if back < b + both { back } else { b + both };
        let (least, most) = ((-0.5 / a) * back, (0.5 / a) * (both - b));
        let (least, most) = if emf < 0.0 { (-most, -least) } else { (least, most) };

        let DcLinkLimits { i_q, why, .. } = limits;
        // Kinetic buffering has priority over the limit.
        if least > i_q.0 {
            (i_q.0, why.0) = (if least < i_q.1 { least } else { i_q.1 }, Limiting::Power);
        }
        if most < i_q.1 {
            (i_q.1, why.1) = (if most > i_q.0 { most } else { i_q.0 }, Limiting::Power);
        }
    }
}

#[cfg(all(test, feature = "power-limit"))]
mod tests;
