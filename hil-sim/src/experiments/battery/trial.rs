//! The result of a run of the battery.

use super::kind::Kind;
use crate::prelude::*;

/// A state that lasts longer, s, should have been noticed.
pub const UNNOTICED_S: f64 = 0.5;
/// Classes of the histogram in a degree.
pub const CLASSES_PER_DEG: f64 = 10.0;
/// The last class of the histogram, that of 180°.
pub const LARGEST_CLASS: usize = (180.0 * CLASSES_PER_DEG) as usize;
/// A learned limit below this share of the nominal one is a lower one.
const LIMITED_SHARE: f64 = 0.999;

/// Why a run has not begun.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
pub enum Refused {
    /// The drive refused to start with the fault of this number.
    #[error("fault {0}")]
    Start(u8),
    /// It refused to learn before.
    #[error("fault {0} while it learned")]
    Learning(u8),
    /// It refused the command, or did not get as far as to regulate.
    #[error("{0}")]
    Otherwise(String),
}

/// The result of a run of the battery or of the whole range; what the experiment does not give is at its default.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Trial {
    /// Its seed.
    pub seed: u64,
    /// Its kind, in the battery.
    pub kind: Option<Kind>,
    /// Kind and region, in the whole range.
    pub case: String,
    /// Speed, rpm on four poles, and torque current, A, that were drawn; in the battery the largest reference.
    pub rpm: f64,
    /// See `rpm`.
    #[serde(rename = "iq_a")]
    pub i_q: f64,
    /// Angle error while the drive regulated, true minus estimated, degrees.
    pub error: Stats,
    /// How often the magnitude was in each class of 0.1° that occurred: number of the class, and of samples.
    pub histogram: Vec<(u32, u32)>,
    /// Largest error from the start on, that of a shaft brought up to speed and of the settling included, and none
    /// after the flux was turned; degrees.
    pub largest_deg: f64,
    /// Longest time for which the angle was wrong while the drive regulated, s; after a turn of the flux, if there is one.
    pub wrong_s: f64,
    /// Longest time for which the error was beyond 45° while the drive regulated, s; likewise.
    pub lost_s: f64,
    /// Longest time for which the flux was off while the drive regulated, s; likewise.
    pub flux_off_s: f64,
    /// Whether the angle was wrong or the flux off to the end of the run, and long enough to be noticed.
    pub stuck: bool,
    /// Largest phase current, A; in the whole range from the start on a turning shaft on, where there is one.
    pub peak_a: f64,
    /// Least and largest voltage of the dc link, V.
    pub dc_link_v: (f64, f64),
    /// Time until a turning shaft was caught, or a stop had ended, s.
    pub took_s: Option<f64>,
    /// Torque current that the drive allows, in relation to the [nominal limit](super::nominal_limit_a).
    pub limit_share: Option<f64>,
    /// Mean torque of the motor minus that of the torque current that the drive has taken, in the direction of the
    /// latter and in relation to the torque at the nominal limit; of a run at constant torque that reached its end.
    pub torque_error: Option<f64>,
    /// Number of the fault that stopped the drive while it regulated.
    pub trip: Option<u8>,
    /// Whether angle and flux were sound from the first reference until then.
    pub sound_stop: bool,
    /// Why it has not begun.
    pub refused: Option<Refused>,
}

impl Trial {
    /// A run with a drive that refused to learn, with this fault.
    pub fn unlearned(seed: u64, fault: u8) -> Self {
        Self { seed, refused: Some(Refused::Learning(fault)), ..Self::default() }
    }

    /// The fault with which start or learning was refused.
    pub fn refused_by(&self) -> Option<u8> {
        match self.refused {
            Some(Refused::Start(fault) | Refused::Learning(fault)) => Some(fault),
            _ => None,
        }
    }

    /// Whether the error was beyond 45° while the drive regulated.
    pub fn is_lost(&self) -> bool {
        self.largest_deg > LOST_DEG
    }

    /// Whether the angle was wrong for so long that the drive should have noticed.
    pub fn is_wrong(&self) -> bool {
        self.wrong_s > UNNOTICED_S
    }

    /// Whether the flux was off for so long.
    pub fn is_flux_off(&self) -> bool {
        self.flux_off_s > UNNOTICED_S
    }

    /// Whether the drive was silently wrong: angle or flux, for so long.
    pub fn is_silent(&self) -> bool {
        self.is_wrong() || self.is_flux_off()
    }

    /// Whether the drive has learned a lower limit of the torque current than the nominal one.
    pub fn is_limited(&self) -> bool {
        self.limit_share.is_some_and(|share| share < LIMITED_SHARE)
    }

    /// The reason why the run is none that a drive should have, after its kind and seed.
    pub fn failure(&self) -> Option<String> {
        let fault = |code: u8| {
            let fault = Fault::ALL.iter().copied().find(|fault| fault.code() == code);
            fault.map_or_else(|| format!("fault {code}"), fault_text)
        };
        let stops = self.trip.filter(|_| !self.kind.is_some_and(Kind::turns_flux));
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
