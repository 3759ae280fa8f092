//! The result of a course.

use super::kind::Kind;
use crate::prelude::*;

/// Duration, s, after which a state should have been detected.
pub const UNNOTICED_S: f64 = 0.5;
/// Classes of the histogram per degree.
pub const CLASSES_PER_DEG: f64 = 10.0;
/// The last class of the histogram, for 180°.
pub const LARGEST_CLASS: usize = (180.0 * CLASSES_PER_DEG) as usize;
/// Share of the nominal limit below which a learned limit counts as lower.
const LIMITED_SHARE: f64 = 0.999;

/// Reasons for which a run has not begun.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
pub enum Refused {
    /// The drive refused to start with the fault of this number.
    #[error("fault {0}")]
    Start(u8),
    /// The drive refused the saliency self-commissioning before.
    #[error("fault {0} while it learned")]
    Learning(u8),
    /// The drive refused the command, or did not reach regulation.
    #[error("{0}")]
    Otherwise(String),
}

/// The result of a run of the stress test or of the full range; values that the experiment does not give have their defaults.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Trial {
    /// Its seed.
    pub seed: u64,
    /// Its kind, in the stress test.
    pub kind: Option<Kind>,
    /// Kind and region, in the full range.
    pub case: String,
    /// Random speed, rpm on four poles, and random q-axis current, A; in the stress test the largest reference.
    pub rpm: f64,
    /// See `rpm`.
    #[serde(rename = "iq_a")]
    pub i_q: f64,
    /// Angle error while the drive regulated, true minus estimated, degrees.
    pub error: Stats,
    /// Number of samples in each occurring class of 0.1° of the magnitude: number of the class, and of samples.
    pub histogram: Vec<(u32, u32)>,
    /// Largest error from the start, including the run-up of the shaft and the settling, but nothing after a sudden
    /// rotation of the flux; degrees.
    pub largest_deg: f64,
    /// Longest time for which the angle was wrong while the drive regulated, s; after a rotation of the flux, if there is one.
    pub wrong_s: f64,
    /// Longest time for which the error exceeded 45° while the drive regulated, s; after a rotation of the flux, if there is one.
    pub lost_s: f64,
    /// Longest time for which the flux was off while the drive regulated, s; after a rotation of the flux, if there is one.
    pub flux_off_s: f64,
    /// Whether the angle was wrong or the flux off until the end of the run, for long enough that the drive should have detected it.
    pub stuck: bool,
    /// Largest phase current, A; in the full range with a flying start, from that start.
    pub peak_a: f64,
    /// Lowest and highest voltage of the dc link, V.
    pub dc_link_v: (f64, f64),
    /// Time until a flying start found the flux, or a stop had ended, s.
    pub took_s: Option<f64>,
    /// q-axis current that the drive allows, relative to the [nominal limit](super::nominal_limit_a).
    pub limit_share: Option<f64>,
    /// Mean torque of the motor minus the torque of the q-axis current that the drive accepted, in the direction of
    /// that current and relative to the torque at the nominal limit; only for a run at constant torque that reached its
    /// end.
    pub torque_error: Option<f64>,
    /// Number of the fault that stopped the drive while it regulated.
    pub trip: Option<u8>,
    /// Whether the course rotates the flux: then a stop is no failure.
    pub turns_flux: bool,
    /// Whether angle and flux were right from the first reference until the stop.
    pub sound_stop: bool,
    /// Reason why the run has not begun.
    pub refused: Option<Refused>,
}

impl Trial {
    /// Makes the result of a run with a drive that refused the saliency self-commissioning with this fault.
    pub fn unlearned(seed: u64, fault: u8) -> Self {
        Self { seed, refused: Some(Refused::Learning(fault)), ..Self::default() }
    }

    /// Returns the fault with which the start or the saliency self-commissioning was refused.
    pub fn refused_by(&self) -> Option<u8> {
        match self.refused {
            Some(Refused::Start(fault) | Refused::Learning(fault)) => Some(fault),
            _ => None,
        }
    }

    /// Whether the error exceeded 45° while the drive regulated.
    pub fn is_lost(&self) -> bool {
        is_lost(self.largest_deg, false)
    }

    /// Whether the error exceeded 45°, or the drive stopped although its flux was not rotated.
    pub fn is_lost_or_stopped(&self) -> bool {
        is_lost(self.largest_deg, self.trip.is_some() && !self.turns_flux)
    }

    /// Whether the angle was wrong for so long that the drive should have detected it.
    pub fn is_wrong(&self) -> bool {
        self.wrong_s > UNNOTICED_S
    }

    /// Whether the flux was off for so long that the drive should have detected it.
    pub fn is_flux_off(&self) -> bool {
        self.flux_off_s > UNNOTICED_S
    }

    /// Whether the drive had an undetected error of angle or flux.
    pub fn is_silent(&self) -> bool {
        self.is_wrong() || self.is_flux_off()
    }

    /// Whether the drive has learned a lower limit of the q-axis current than the nominal one.
    pub fn is_limited(&self) -> bool {
        self.limit_share.is_some_and(|share| share < LIMITED_SHARE)
    }

    /// Returns the reason why the run is a failure, after its kind and seed.
    pub fn failure(&self) -> Option<String> {
        let fault = |code: u8| {
            let fault = Fault::ALL.iter().copied().find(|fault| fault.code() == code);
            fault.map_or_else(|| format!("fault {code}"), fault_text)
        };
        let stops = self.trip.filter(|_| !self.turns_flux);
        let reasons = [
            self.refused_by().map(|code| format!("start refused with {}", fault(code))),
            self.is_wrong().then(|| format!("angle wrong for {:.2} s", self.wrong_s)),
            self.is_flux_off().then(|| format!("flux off for {:.2} s", self.flux_off_s)),
            self.is_lost().then(|| format!("angle error beyond {LOST_DEG}°")),
            stops.map(fault),
        ];
        let reason = reasons.into_iter().flatten().collect::<Vec<_>>().join(", ");
        if reason.is_empty() {
            return None;
        }
        let kind = self.kind.map(Kind::name).unwrap_or_default();
        Some(format!("{kind}, seed {}: {reason}", self.seed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive that stops after its flux was rotated has done its work; an angle error beyond 45° is lost in any course.
    #[test]
    fn a_stop_after_a_rotation_of_the_flux_is_no_failure() {
        let of = |largest_deg, trip, turns_flux| {
            let trial = Trial { largest_deg, trip, turns_flux, ..Trial::default() };
            (trial.is_lost(), trial.is_lost_or_stopped(), trial.failure().is_some())
        };
        assert_eq!(of(5.0, Some(13), true), (false, false, false));
        assert_eq!(of(5.0, Some(13), false), (false, true, true));
        assert_eq!(of(46.0, None, true), (true, true, true));
        assert_eq!(of(45.0, None, false), (false, false, false));
    }
}
