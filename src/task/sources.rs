//! Cross-checks of clock and reference voltage: the core clock against the two oscillators inside the chip, HSI and LSI, the ADC
//! reference voltage against the chip's own reference. If the crystal or the supply is off, currents, voltages, times and their limits are
//! all wrong.

use core::sync::atomic::Ordering;

use drive_core::{Fault, Hardware};

use crate::task::control::{FAULTS_FROM_MAIN, WINDOW_ON};
use induction_drive::board;
use induction_drive::chip::clocks::Source;
use induction_drive::chip::{StartError, adc, time};

/// Time between two measurements, ms, and to one that repeats a suspicious result.
const PAUSE_MS: [u32; 2] = [1000, 1];

/// The measurements.
pub struct Sources {
    internal: bool,
    /// The errors that the last measurement found.
    suspected: Hardware,
    measured_ms: u32,
    pause_ms: u32,
}

impl Sources {
    /// Measures for the first time, with the control running.
    ///
    /// # Errors
    /// The error that two measurements have found.
    pub fn new(source: Source) -> Result<Self, StartError> {
        let (internal, suspected) = (source == Source::Internal, Hardware::empty());
        let mut new = Self { internal, suspected, measured_ms: 0, pause_ms: PAUSE_MS[0] };
        new.measure();
        let wrong = new.measure();
        if wrong.contains(Hardware::CLOCK) {
            Err(Fault::WrongClock.text())
        } else if wrong.contains(Hardware::REFERENCE) {
            Err(Fault::WrongReference.text())
        } else {
            Ok(new)
        }
    }

    /// Measures once a second, for less than a millisecond, and tells the control the errors found.
    pub fn watch(&mut self, now_ms: u32) {
        if now_ms.wrapping_sub(self.measured_ms) >= self.pause_ms {
            self.measured_ms = now_ms;
            FAULTS_FROM_MAIN.store(WINDOW_ON | self.measure().bits(), Ordering::Relaxed);
        }
    }

    /// The errors that are present now and were at the previous measurement.
    fn measure(&mut self) -> Hardware {
        let clocks = time::captured().is_some_and(|n| board::clocks_agree(n, self.internal));
        let (code, then) = adc::own_reference();
        let references = board::references_agree(code, then);
        let mut found = Hardware::empty();
        found.set(Hardware::CLOCK, !clocks);
        found.set(Hardware::REFERENCE, !references);
        let before = core::mem::replace(&mut self.suspected, found);
        self.pause_ms = PAUSE_MS[usize::from(!before.contains(found))];
        before & found
    }
}
