//! Quantities that may be used and checks that may act, by the phase of the flux: one table with a row per phase, which
//! `docs/control-law.md` shows.

use Check::{Narrow, Wide};
use Lock::{Baseline, Off, Watch};
use Source::{Both, Injection, Nothing, Slip};

use super::{Field, FluxPhase, Frame};
use crate::flux::hand_over::Source;
use crate::{AngleLoop, Coefficients};

/// Tolerance of the comparison of the measured current with the current that voltage and flux explain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Check {
    Off,
    /// A wide tolerance, because a residual flux rotates relative to the new one.
    Wide,
    Narrow,
}

/// Task of the lock monitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lock {
    Off,
    /// The monitor measures its baseline.
    Baseline,
    /// The monitor watches. If the start has not measured the baseline, the monitor measures it first.
    Watch,
}

/// Quantities that may be used and checks that may act in a control period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Trust {
    pub source: Source,
    /// Whether the frame rotates with the rotor.
    pub rotates: bool,
    pub lock: Lock,
    pub current: Check,
    /// Whether the mean of the unexplained voltage is kept and judged; otherwise it is reset.
    pub mean_voltage: bool,
    /// Whether flux and injection show the stator resistance.
    pub resistance: bool,
    /// Whether the inverter voltage error is measured, and with it the resistance.
    pub measures_drop: bool,
}

impl Trust {
    /// Whether the back-EMF observer takes part in the angle, or follows it.
    pub fn observes(&self) -> bool {
        self.source != Slip
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Returns the row of the present phase, `elapsed` periods after it began.
    #[rustfmt::skip] // A phase, a row.
    pub(super) fn trust(&self, s: &Field<L::State>, elapsed: u32) -> Trust {
        match (&s.flux, s.frame) {
            // Flying start: the shaft is searched; below, it was found, and at first the injection alone, then also the observer
            // rotates the frame.
            (FluxPhase::Search(search), _) => Trust { source: Nothing, rotates: search.at.freq != 0.0, lock: Off, current: Check::Off, mean_voltage: false, resistance: false, measures_drop: false },
            // There is neither current nor flux.
            (FluxPhase::Asymmetry(_), _) => Trust { source: Slip, rotates: false, lock: Off, current: Check::Off, mean_voltage: false, resistance: false, measures_drop: false },
            (FluxPhase::Build { from, .. }, _) => match &self.flying_start {
                Some(start) if elapsed.wrapping_sub(*from) < start.injection_only => Trust { source: Injection, rotates: true, lock: Off, current: Check::Off, mean_voltage: false, resistance: false, measures_drop: false },
                _ => Trust { source: Both, rotates: true, lock: Baseline, current: Wide, mean_voltage: true, resistance: false, measures_drop: false },
            },
            (FluxPhase::Hold, Frame::LockedShaft) => Trust { source: Slip, rotates: false, lock: Baseline, current: Narrow, mean_voltage: false, resistance: false, measures_drop: true },
            (FluxPhase::Hold, Frame::Encoder | Frame::Tracked) => Trust { source: Both, rotates: false, lock: Baseline, current: Narrow, mean_voltage: false, resistance: false, measures_drop: true },
            (FluxPhase::Verify | FluxPhase::Prove | FluxPhase::Ready(_) | FluxPhase::Learn(_), Frame::LockedShaft) => Trust { source: Slip, rotates: true, lock: Off, current: Narrow, mean_voltage: true, resistance: false, measures_drop: false },
            (FluxPhase::Verify | FluxPhase::Prove | FluxPhase::Ready(_) | FluxPhase::Learn(_), Frame::Encoder | Frame::Tracked) => Trust { source: Both, rotates: true, lock: Watch, current: Narrow, mean_voltage: true, resistance: true, measures_drop: false },
        }
    }
}
