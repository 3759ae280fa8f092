//! Faults with their permanent numbers.

use core::fmt;

macro_rules! faults {
    ($($(#[$doc:meta])* $name:ident = $code:literal, $text:literal;)+) => {
        /// Reason why the drive switched its outputs off.
        ///
        /// A code never changes its meaning and is never used again. Codes below 64 belong to the
        /// drive, those from 64 on to the firmware around it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        #[non_exhaustive]
        pub enum Fault {
            $($(#[$doc])* #[doc = concat!($text, ".")] $name = $code,)+
        }

        impl Fault {
            /// All faults, by code.
            pub const ALL: &[Self] = &[$(Self::$name,)+];

            /// Short description.
            pub const fn meaning(self) -> &'static str {
                match self { $(Self::$name => $text,)+ }
            }
        }
    };
}

faults! {
    OverCurrentA = 1, "over-current in phase a";
    OverCurrentB = 2, "over-current in phase b";
    OverCurrentC = 3, "over-current in phase c, computed as -(a + b)";
    DcLinkOverVoltage = 4, "dc link above its limit";
    DcLinkUnderVoltage = 5, "dc link below its limit";
    OverSpeed = 6, "speed above its limit";
    SensorSaturatedA = 7, "current sensor a at the end of its range, shorted or open";
    SensorSaturatedB = 8, "current sensor b at the end of its range, shorted or open";
    CarrierMissingA = 9, "no carrier current in sensor a where there must be some: open or stuck";
    CarrierMissingB = 10, "no carrier current in sensor b where there must be some: open or stuck";
    CurrentNotAsPredicted = 11, "measured current does not follow the applied voltage";
    LostAngle = 12, "the flux angle is lost";
    NonFiniteSettings = 13, "a setting is not a finite number";
    NonFiniteCommand = 14, "a reference is not a finite number";
    NonFiniteState = 15, "a state of the control is not a finite number";
    OffsetA = 16, "offset of current sensor a out of range at start";
    OffsetB = 17, "offset of current sensor b out of range at start";
    OverTemperature = 18, "heat sink too hot";
    Encoder = 19, "encoder jumped or stood still as the rotor cannot";
    Break = 20, "the power stage pulled the break input";
    AnalogWatchdog = 21, "over-current seen by the analog watchdog";
    DeadlineMiss = 22, "the control interrupt missed its deadline";
    ConverterOverrun = 23, "a conversion was lost";
    ClockFailure = 24, "the clock failed";
    NoSaliency = 25, "the motor shows too little saliency for the injection";
    LostLock = 26, "the flux is not where the tracked angle says";
    ShaftNotLocked = 27, "the shaft moved, or the flux did not turn, while learning";
    NothingLearned = 28, "what was learned is not believable";
    CarrierWeak = 29, "too little carrier current: open phase, or the inverter does not put it out";
    WiringNoCurrent = 30, "wiring check: a sensor sees no current, it or a phase is open";
    WiringPolarityA = 31, "wiring check: current sensor a is the wrong way round";
    WiringPolarityB = 32, "wiring check: current sensor b is the wrong way round";
    WiringExchanged = 33, "wiring check: current sensors or gates are on the wrong phases";
    WiringCurrent = 34, "wiring check: more current than the motor's settings explain";
    CarrierNoRoom = 35, "the voltage left by the fundamental is too small for the carrier";
    SensorNoisyA = 36, "current sensor a is too noisy for the injection";
    SensorNoisyB = 37, "current sensor b is too noisy for the injection";
}

impl Fault {
    /// Number of the fault.
    pub const fn code(self) -> u8 {
        self as u8
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.meaning())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers are in logs and manuals: this list may grow, nothing in it may change.
    #[test]
    fn codes_never_change() {
        let table = [
            (1, Fault::OverCurrentA),
            (2, Fault::OverCurrentB),
            (3, Fault::OverCurrentC),
            (4, Fault::DcLinkOverVoltage),
            (5, Fault::DcLinkUnderVoltage),
            (6, Fault::OverSpeed),
            (7, Fault::SensorSaturatedA),
            (8, Fault::SensorSaturatedB),
            (9, Fault::CarrierMissingA),
            (10, Fault::CarrierMissingB),
            (11, Fault::CurrentNotAsPredicted),
            (12, Fault::LostAngle),
            (13, Fault::NonFiniteSettings),
            (14, Fault::NonFiniteCommand),
            (15, Fault::NonFiniteState),
            (16, Fault::OffsetA),
            (17, Fault::OffsetB),
            (18, Fault::OverTemperature),
            (19, Fault::Encoder),
            (20, Fault::Break),
            (21, Fault::AnalogWatchdog),
            (22, Fault::DeadlineMiss),
            (23, Fault::ConverterOverrun),
            (24, Fault::ClockFailure),
            (25, Fault::NoSaliency),
            (26, Fault::LostLock),
            (27, Fault::ShaftNotLocked),
            (28, Fault::NothingLearned),
            (29, Fault::CarrierWeak),
            (30, Fault::WiringNoCurrent),
            (31, Fault::WiringPolarityA),
            (32, Fault::WiringPolarityB),
            (33, Fault::WiringExchanged),
            (34, Fault::WiringCurrent),
            (35, Fault::CarrierNoRoom),
            (36, Fault::SensorNoisyA),
            (37, Fault::SensorNoisyB),
        ];
        for (code, fault) in table {
            assert_eq!(fault.code(), code);
        }
        assert_eq!(table.len(), Fault::ALL.len());
    }

    /// The page of the faults lists these.
    #[test]
    fn the_manual_lists_them() {
        let manual = include_str!("../../docs/faults.md");
        for fault in Fault::ALL {
            let line = format!("| {} | {fault} |", fault.code());
            assert!(manual.contains(&line), "{line}");
        }
    }
}
