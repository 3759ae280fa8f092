//! What must hold in every step.

use super::Drive;
use crate::current::sensing::{Measured, SensingState};
use crate::drive::coefficients::Coefficients;
use crate::fault::Fault;
use crate::io::{Hardware, Sample};

impl Coefficients {
    /// What must hold in every period with the outputs on or about to be.
    #[inline]
    pub(super) fn protect(
        &self,
        sensing: &SensingState,
        sample: &Sample,
        measured: &Measured,
    ) -> Result<(), Fault> {
        let fine = sample.hardware == Hardware::empty()
            && self.sensing.is_well_inside(sensing, sample, measured.phases.c);
        if fine {
            return Ok(());
        }
        let wrong =
            self.what_is_wrong(sample, measured.phases.a, measured.phases.b, measured.dc_link);
        wrong.map_or(Ok(()), Err)
    }

    /// The first thing that is wrong, if anything is, with the currents in A and the dc link in V.
    #[inline(never)]
    fn what_is_wrong(&self, sample: &Sample, a: f32, b: f32, dc_link: f32) -> Option<Fault> {
        if sample.hardware != Hardware::empty() {
            return Some(of_hardware(sample.hardware));
        }
        if let Some(fault) = self.sensing.check(sample) {
            return Some(fault);
        }
        let (p, trip_a) = (&self.protection, self.sensing.trip_a);
        if a.abs() > trip_a {
            Some(Fault::OverCurrentA)
        } else if b.abs() > trip_a {
            Some(Fault::OverCurrentB)
        } else if (a + b).abs() > trip_a {
            Some(Fault::OverCurrentC)
        } else if dc_link > p.dc_over {
            Some(Fault::DcLinkOverVoltage)
        } else if dc_link < p.dc_under {
            Some(Fault::DcLinkUnderVoltage)
        } else {
            None
        }
    }
}

impl Drive {
    /// Which of settings, references and state is to blame when a result is not finite.
    pub(super) fn not_finite(&self) -> Option<Fault> {
        let r = &self.control.references;
        if !self.c.is_finite() {
            Some(Fault::NonFiniteSettings)
        } else if !(r.current.is_finite() && (r.speed + r.turns).is_finite()) {
            Some(Fault::NonFiniteCommand)
        } else if !self.control.estimator.is_finite() {
            Some(Fault::NonFiniteState)
        } else {
            None
        }
    }
}

/// The most telling of the events: what switched off first comes first.
fn of_hardware(events: Hardware) -> Fault {
    if events.intersects(Hardware::BREAK) {
        Fault::Break
    } else if events.intersects(Hardware::ANALOG_WATCHDOG) {
        Fault::AnalogWatchdog
    } else if events.intersects(Hardware::CLOCK_FAILURE) {
        Fault::ClockFailure
    } else if events.intersects(Hardware::DEADLINE_MISS) {
        Fault::DeadlineMiss
    } else {
        Fault::ConverterOverrun
    }
}
