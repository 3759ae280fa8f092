//! What was learned, as the console lists it.

use core::fmt;

use drive_core::identify::learning::{Fitted, Learned};
use drive_core::math::decimal::Fixed;
use drive_core::settings::table::STEP_A;

/// A line of the list.
pub enum Line<'a> {
    /// What stands for all currents.
    Summary { found: &'a Learned, unbelievable: bool },
    /// What the numbers below are.
    Header,
    /// A current, A, with the reference and the carrier current there.
    Point([f32; 3]),
}

/// Line number `i`, if there are so many.
pub fn line(found: &Learned, unbelievable: bool, i: u16) -> Option<Line<'_>> {
    let n = match i {
        0 => return Some(Line::Summary { found, unbelievable }),
        1 => return Some(Line::Header),
        _ => usize::from(i) - 2,
    };
    let reference = found.reference.points().get(n).filter(|_| n <= found.points)?;
    let carrier = found.carrier.as_ref().and_then(|table| table.points().get(n));
    // Not learned: what was set holds.
    Some(Line::Point([n as f32 * STEP_A, *reference, carrier.copied().unwrap_or(f32::NAN)]))
}

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Summary { found, unbelievable } => {
                f.write_str(if *unbelievable { "not believable, not used: " } else { "" })?;
                write!(f, "asymmetry {}; ", Fixed::<5>(found.asymmetry))?;
                fit(f, "gain mismatch", &found.gain_mismatch)?;
                fit(f, "current saliency", &found.current_saliency)?;
                write!(f, "flux saliency {}", Fixed::<5>(found.flux_saliency))
            }
            Self::Header => f.write_str("i_q,reference,carrier"),
            Self::Point([i_q, reference, carrier]) => {
                write!(f, "{},{},", Fixed::<2>(*i_q), Fixed::<5>(*reference))?;
                if carrier.is_nan() { Ok(()) } else { Fixed::<5>(*carrier).fmt(f) }
            }
        }
    }
}

fn fit(f: &mut fmt::Formatter<'_>, name: &str, fitted: &Fitted) -> fmt::Result {
    let (value, misfit) = (Fixed::<5>(fitted.value), Fixed::<5>(fitted.misfit));
    let used = if fitted.accepted { "" } else { ", not used" };
    write!(f, "{name} {value} (misfit {misfit}{used}); ")
}
