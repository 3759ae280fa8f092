//! Faults with their permanent numbers, likely causes and cures.
//!
//! This file has the numbers and texts. Causes and cures come from the page `docs/faults.md`, which the build script reads.

use core::fmt;

macro_rules! faults {
    ($($name:ident = $code:literal, $text:literal;)+) => {
        /// Reason why the drive switched its outputs off.
        ///
        /// A code never changes its meaning and is never used again. Codes below 64 belong to the
        /// drive, codes of 64 and above to the firmware around it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        #[non_exhaustive]
        pub enum Fault {
            $(#[doc = concat!($text, ".")] $name = $code,)+
        }

        impl Fault {
            /// All faults, by code.
            pub const ALL: &[Self] = &[$(Self::$name,)+];

            /// Returns a short description.
            #[cold]
            pub const fn text(self) -> &'static str {
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
    CarrierMissingA = 9, "no injection current in sensor a where there must be some: open or stuck";
    CarrierMissingB = 10, "no injection current in sensor b where there must be some: open or stuck";
    CurrentNotAsPredicted = 11, "measured current does not follow the applied voltage";
    LostAngle = 12, "the flux angle is lost";
    NonFiniteSettings = 13, "a setting is not a finite number";
    NonFiniteCommand = 14, "a reference is not a finite number";
    NonFiniteState = 15, "a state of the control is not a finite number";
    OffsetA = 16, "offset of current sensor a out of range at start";
    OffsetB = 17, "offset of current sensor b out of range at start";
    OverTemperature = 18, "heat sink too hot";
    Encoder = 19, "encoder jumped or stopped in a way that the rotor cannot";
    Break = 20, "the power stage pulled the break input";
    AnalogWatchdog = 21, "over-current seen by the analog watchdog";
    DeadlineMiss = 22, "the control interrupt missed its deadline";
    ConverterOverrun = 23, "a conversion was lost";
    // 24 was a failure of the clock, which now resets the chip.
    NoSaliency = 25, "too little saliency, or the shaft turns";
    LostLock = 26, "the flux is not where the tracked angle says";
    ShaftNotLocked = 27, "the shaft moved, or the flux did not turn, while learning";
    NothingLearned = 28, "the learned saliency or asymmetry is not plausible";
    CarrierWeak = 29, "too little injection current: open phase, or the inverter does not inject";
    WiringNoCurrent = 30, "wiring check: a sensor sees no current, it or a phase is open";
    WiringPolarityA = 31, "wiring check: current sensor a is the wrong way round";
    WiringPolarityB = 32, "wiring check: current sensor b is the wrong way round";
    WiringExchanged = 33, "wiring check: current sensors or gates are on the wrong phases";
    WiringCurrent = 34, "wiring check: more current than the settings of the motor can explain";
    CarrierNoRoom = 35, "the voltage left by the fundamental is too small for the injection";
    SensorNoisyA = 36, "current sensor a is too noisy for the injection";
    SensorNoisyB = 37, "current sensor b is too noisy for the injection";
    SensorSaturatedC = 38, "current sensor c at the end of its range, shorted or open";
    OffsetC = 39, "offset of current sensor c out of range at start";
    CurrentSum = 40, "the three phase currents do not sum to zero";
    FluxNotAsPredicted = 41, "the back-EMF does not fit the tracked angle and flux";
    SlopeTooSmall = 42, "the saliency changes too little with the angle to be tracked";
    MotorOverload = 43, "the motor has carried too much current for too long";
    InverterOverload = 44, "the inverter has carried too much current for too long";
    ThermistorOpen = 45, "thermistor of the heat sink open: colder than -40 degC";
    ThermistorShorted = 46, "thermistor of the heat sink shorted: hotter than 200 degC";
    NotCaught = 47, "the flying start failed";
    Stalled = 48, "the motor stays at its current limit and hardly turns";
    ChopperOff = 49, "the chip has switched the brake chopper off";
    WrongClock = 50, "the core clock and the chip's own oscillators do not agree";
    WrongReference = 51, "the reference voltage of the ADCs is wrong";
    SensorSilentA = 52, "no change in current sensor a while the current rotates: open or stuck";
    SensorSilentB = 53, "no change in current sensor b while the current rotates: open or stuck";
    MotorSensorOpen = 54, "temperature sensor of the motor open";
    MotorSensorShorted = 55, "temperature sensor of the motor shorted";
    MotorHot = 56, "motor too hot by its temperature sensor";
    MotorSensorUnread = 57, "no reading of the motor's temperature sensor came";
    TorqueNotProven = 58, "the torque was not proven: the current did not follow while the brake was closed";
}

impl Fault {
    /// Returns the number of the fault.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Whether the current or the temperature was beyond the limits of the power stage, or the power stage reported it. Another start
    /// into the same wiring would stress its switches.
    pub const fn is_of_the_power_stage(self) -> bool {
        let over_current =
            matches!(self, Self::OverCurrentA | Self::OverCurrentB | Self::OverCurrentC);
        over_current || matches!(self, Self::OverTemperature | Self::Break | Self::AnalogWatchdog)
    }

    /// Returns the result of a check: this fault, unless the measurement is `sound`. A comparison with NaN is false.
    #[inline]
    pub(crate) const fn unless(self, sound: bool) -> Result<(), Self> {
        if sound { Ok(()) } else { Err(self) }
    }

    /// Returns the likely causes, the most likely first.
    pub const fn causes(self) -> &'static [&'static str] {
        remedy(self.code()).0
    }

    /// Returns the remedy, one sentence without its full stop.
    pub const fn cure(self) -> &'static str {
        remedy(self.code()).1
    }
}

/// Returns the causes and the cure of the fault with this number.
#[expect(clippy::manual_range_patterns, reason = "the build script lists the numbers")]
#[cold]
const fn remedy(code: u8) -> (&'static [&'static str], &'static str) {
    include!(concat!(env!("OUT_DIR"), "/remedies.rs"))
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

#[cfg(test)]
mod tests;
