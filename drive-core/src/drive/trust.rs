//! Quantities that may be used and checks that may act, by the phase of the flux: one table, a row a phase. `docs/control-law.md`
//! prints it.

use Judged::{No, Strictly, Tolerantly};
use Lock::{Baseline, Off, Watch};
use Source::{Both, Injection, Nothing, Slip};

use super::{Field, FluxPhase, Frame};
use crate::Coefficients;
use crate::flux::hand_over::Source;

/// How strictly the measured current is compared with that which voltage and flux explain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Judged {
    No,
    /// Residual flux turns relative to the new one.
    Tolerantly,
    Strictly,
}

/// Task of the lock monitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lock {
    Off,
    /// It measures its baseline.
    Baseline,
    /// It judges; where the start has not measured the baseline, it measures it first.
    Watch,
}

/// Quantities that may be used and checks that may act in a control period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Trust {
    pub source: Source,
    /// Whether the frame turns with the rotor.
    pub turns: bool,
    pub lock: Lock,
    pub current: Judged,
    /// Whether the mean of the unexplained voltage is kept and judged; otherwise it begins anew.
    pub mean: bool,
    /// Whether flux and injection show the stator resistance.
    pub resistance: bool,
    /// Whether the drop of the inverter is measured, and with it the resistance.
    pub drop: bool,
}

impl Trust {
    /// Whether the observer has a part in the angle, or follows it.
    pub fn observes(&self) -> bool {
        self.source != Slip
    }
}

impl Field {
    /// The row of the present phase, `elapsed` periods after it began.
    #[rustfmt::skip] // A phase, a row.
    pub(super) fn trust(&self, c: &Coefficients, elapsed: u32) -> Trust {
        match (&self.flux, self.frame) {
            // A turning shaft is looked for. It was found, and the injection alone turns the frame. The observer does as well.
            (FluxPhase::Search(_), _) => Trust { source: Nothing, turns: false, lock: Off, current: No, mean: false, resistance: false, drop: false },
            // There is neither current nor flux.
            (FluxPhase::Asymmetry(_), _) => Trust { source: Slip, turns: false, lock: Off, current: No, mean: false, resistance: false, drop: false },
            (FluxPhase::Build { from }, _) => match &c.catching {
                Some(c) if elapsed.wrapping_sub(*from) < c.alone => Trust { source: Injection, turns: true, lock: Off, current: No, mean: false, resistance: false, drop: false },
                _ => Trust { source: Both, turns: true, lock: Baseline, current: Tolerantly, mean: true, resistance: false, drop: false },
            },
            (FluxPhase::Hold, Frame::LockedShaft) => Trust { source: Slip, turns: false, lock: Baseline, current: Strictly, mean: false, resistance: false, drop: true },
            (FluxPhase::Hold, Frame::Encoder | Frame::Tracked) => Trust { source: Both, turns: false, lock: Baseline, current: Strictly, mean: false, resistance: false, drop: true },
            (FluxPhase::Verify | FluxPhase::Prove | FluxPhase::Ready(_) | FluxPhase::Learn(_), Frame::LockedShaft) => Trust { source: Slip, turns: true, lock: Off, current: Strictly, mean: true, resistance: false, drop: false },
            (FluxPhase::Verify | FluxPhase::Prove | FluxPhase::Ready(_) | FluxPhase::Learn(_), Frame::Encoder | Frame::Tracked) => Trust { source: Both, turns: true, lock: Watch, current: Strictly, mean: true, resistance: true, drop: false },
        }
    }
}
