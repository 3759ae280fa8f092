//! The analog reference: a share of the full speed, or the reason why it is lost.

use crate::board::ADC_FULL_SCALE;
use crate::boards::converter::{CODES, REFERENCE_V};
use crate::boards::{ANALOG, Terminals};
use crate::terminals::settings::Reference;

/// Consecutive readings after which a reference counts as lost, one per millisecond; meanwhile the last speed is kept.
pub const LOOKS: u8 = 20;
/// Range of a healthy current loop, mA (as NAMUR NE 43: 3.6 and 21 mA report a failure), and of its signal.
const SOUND_MA: (f32, f32) = (3.6, 21.0);
const SIGNAL_MA: (f32, f32) = (4.0, 20.0);
/// Largest difference of two redundant inputs, share of 10 V.
const AGREES: f32 = 0.03;
/// ADC counts at the end of the range, where the ADC saturates.
const RANGE_END: u16 = ADC_FULL_SCALE - 5;

/// Reason why a reference counts as lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lost {
    /// The ADC gives no result.
    Silent,
    /// Below 3.6 mA.
    Low,
    /// Above 21 mA.
    High,
    /// At the end of the ADC's range.
    End,
    /// Two inputs that should agree differ.
    Differ,
}

impl Lost {
    /// The reason in words.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Silent => "its ADC does not answer",
            Self::Low => "below 3.6 mA: a broken wire, or no supply",
            Self::High => "above 21 mA: a short circuit",
            Self::End => "at the end of the ADC's range",
            Self::Differ => "the two inputs differ by more than 0.3 V",
        }
    }
}

/// The share of the full speed, 0 to 1, from the ADC counts of the first and the second input.
///
/// # Errors
/// The reason why the reference is lost.
pub fn share(
    kind: Reference,
    terminals: &Terminals,
    [first, second, _]: [Option<u16>; ANALOG],
) -> Result<f32, Lost> {
    // The share is 1 at 10 V and at 20 mA.
    let of = |code: u16| f32::from(code) * (REFERENCE_V / f32::from(CODES)) / terminals.full_v;
    let code = first.ok_or(Lost::Silent)?;
    let share = of(code);
    if kind == Reference::Current {
        let ma = share * SIGNAL_MA.1;
        return match ma {
            _ if ma < SOUND_MA.0 => Err(Lost::Low),
            _ if ma > SOUND_MA.1 => Err(Lost::High),
            _ => Ok(((ma - SIGNAL_MA.0) / (SIGNAL_MA.1 - SIGNAL_MA.0)).clamp(0.0, 1.0)),
        };
    }
    // The lower of two references counts.
    let other = match terminals.pins[1] {
        Some(_) => second.ok_or(Lost::Silent)?,
        None => code,
    };
    match of(other) {
        _ if code.max(other) >= RANGE_END => Err(Lost::End),
        other if (share - other).abs() > AGREES => Err(Lost::Differ),
        other => Ok(share.min(other).min(1.0)),
    }
}
