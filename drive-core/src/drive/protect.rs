//! Checks of every step: the sample before it is used, and the state if a result is not finite.

use super::Common;
use crate::AngleLoop;
use crate::drive::coefficients::Coefficients;
use crate::fault::Fault;
use crate::io::{Hardware, Measured};
use crate::protect::wiring_check::{Pulse, WiringCheck, WiringCheckState};

impl<L: AngleLoop> Coefficients<L> {
    /// Checks a sample while the outputs are on or about to be switched on.
    ///
    /// # Errors
    /// The first fault that the sample shows.
    pub(super) fn protect(&self, measured: &Measured) -> Result<(), Fault> {
        let unused =
            if self.dc_link.has_chopper() { Hardware::empty() } else { Hardware::CHOPPER_OFF };
        let events = measured.hardware - unused;
        if !events.is_empty() {
            return Err(of_hardware(events));
        }
        if let Some(fault) = measured.fault {
            return Err(fault);
        }
        let (limits, phases) = (&self.protection, &measured.phases);
        if phases.a.abs() > limits.trip_a {
            Err(Fault::OverCurrentA)
        } else if phases.b.abs() > limits.trip_a {
            Err(Fault::OverCurrentB)
        } else if phases.c.abs() > limits.trip_a {
            Err(Fault::OverCurrentC)
        } else if measured.dc_link > limits.dc_over {
            Err(Fault::DcLinkOverVoltage)
        } else if measured.dc_link < limits.dc_under {
            Err(Fault::DcLinkUnderVoltage)
        } else {
            Ok(())
        }
    }

    /// Runs a period of a pulse train, short voltages without control. Returns `None` after its end.
    ///
    /// # Errors
    /// The fault of a wiring with too much current.
    #[cold]
    pub(super) fn pulse(
        &self,
        pulses: &WiringCheck,
        state: &mut WiringCheckState,
        measured: &Measured,
    ) -> Result<Option<[f32; 3]>, Fault> {
        let Some(Pulse { voltage, current }) = pulses.step(state, measured.phases)? else {
            return Ok(None);
        };
        let signs = self.dead_time.signs(current.to_abc(), crate::Abc::ZERO);
        let compensation = self.dead_time.voltage(signs, measured.dc_link, 0.0);
        Ok(Some(self.modulator.step(voltage, compensation, measured.dc_link).duties))
    }

    /// Returns the fault of a result that is not finite, if the settings or the references are not finite; `goal_is_finite`
    /// tells whether the references of the goal are.
    #[cold]
    pub(super) fn not_finite(&self, k: &Common, goal_is_finite: bool) -> Option<Fault> {
        if !self.is_finite() {
            Some(Fault::NonFiniteSettings)
        } else if !(k.references.current.is_finite() && goal_is_finite) {
            Some(Fault::NonFiniteCommand)
        } else {
            None
        }
    }
}

/// Returns the fault of the most significant event, in the order in which the events switch off. An event without a name is an
/// event of the ADCs.
fn of_hardware(events: Hardware) -> Fault {
    [
        (Hardware::BREAK, Fault::Break),
        (Hardware::ANALOG_WATCHDOG, Fault::AnalogWatchdog),
        (Hardware::DEADLINE_MISS, Fault::DeadlineMiss),
        (Hardware::CONVERTER_OVERRUN, Fault::ConverterOverrun),
        (Hardware::CHOPPER_OFF, Fault::ChopperOff),
        (Hardware::CLOCK, Fault::WrongClock),
        (Hardware::REFERENCE, Fault::WrongReference),
    ]
    .into_iter()
    .find_map(|(event, fault)| events.intersects(event).then_some(fault))
    .unwrap_or(Fault::ConverterOverrun)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::frames::Abc;
    use crate::settings::Settings;

    #[test]
    fn each_limit_trips_beyond_its_value_and_not_at_it() {
        let settings = Settings::default();
        let coefficients = settings.build().unwrap();
        let (trip_a, dc_over_v, dc_under_v) =
            (settings.trip_a(), settings.dc_over_v(), settings.dc_under_v());
        let check = |a: f32, b: f32, dc_link: f32| {
            let phases = Abc::new(a, b, -(a + b));
            coefficients.protect(&Measured { phases, dc_link, ..Measured::default() })
        };
        let (more, half) = (1.001 * trip_a, 0.5 * trip_a);
        for sign in [1.0, -1.0] {
            let at = |a: f32, b: f32| check(sign * a, sign * b, 311.0);
            assert_eq!(at(trip_a, -half), Ok(()));
            assert_eq!(at(more, -half), Err(Fault::OverCurrentA));
            assert_eq!(at(-half, trip_a), Ok(()));
            assert_eq!(at(-half, more), Err(Fault::OverCurrentB));
            assert_eq!(at(half, half), Ok(()));
            assert_eq!(at(half, half * 1.002), Err(Fault::OverCurrentC));
        }
        // An event that has no name is also a fault.
        let hardware = Hardware::from_bits_retain(1 << 7);
        let unknown = Measured { hardware, dc_link: 311.0, ..Measured::default() };
        let found = coefficients.protect(&unknown);
        assert_eq!(found, Err(Fault::ConverterOverrun));
        assert_eq!(check(0.0, 0.0, dc_over_v), Ok(()));
        assert_eq!(check(0.0, 0.0, dc_over_v + 0.1), Err(Fault::DcLinkOverVoltage));
        assert_eq!(check(0.0, 0.0, dc_under_v), Ok(()));
        assert_eq!(check(0.0, 0.0, dc_under_v - 0.1), Err(Fault::DcLinkUnderVoltage));
    }
}
