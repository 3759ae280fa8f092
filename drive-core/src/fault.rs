//! Faults with their permanent numbers, likely causes and cures.

use core::fmt;

macro_rules! faults {
    ($($name:ident = $code:literal, $text:literal, $causes:expr, $cure:expr;)+) => {
        /// Reason why the drive switched its outputs off.
        ///
        /// A code never changes its meaning and is never used again. Codes below 64 belong to the
        /// drive, those from 64 on to the firmware around it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        #[non_exhaustive]
        pub enum Fault {
            $(#[doc = concat!($text, ".")] $name = $code,)+
        }

        impl Fault {
            /// All faults, by code.
            pub const ALL: &[Self] = &[$(Self::$name,)+];

            /// Short description.
            pub const fn text(self) -> &'static str {
                match self { $(Self::$name => $text,)+ }
            }

            /// Likely causes, the most likely first.
            pub const fn causes(self) -> &'static [&'static str] {
                match self { $(Self::$name => $causes,)+ }
            }

            /// Remedy, one sentence without its full stop.
            pub const fn cure(self) -> &'static str {
                match self { $(Self::$name => $cure,)+ }
            }
        }
    };
}

/// Causes and cure of faults that several channels share.
type Shared = (&'static [&'static str], &'static str);

const OVER_CURRENT: Shared = (
    &[
        "short circuit or earth fault in motor or cable",
        "limits.trip_a too close to limits.current_a, without room for carrier and overshoot",
        "motor.* or scales.current_* wrong, so that the current loop is badly designed",
        "wrong flux angle, with faults 11 or 26 in other runs",
    ],
    "disconnect the motor, measure its insulation, then check the settings",
);
const SENSOR_RANGE: Shared = (
    &[
        "wire of the sensor open or shorted, or its supply missing",
        "a current beyond the range of the sensor",
    ],
    "check the sensor, its wires and its supply",
);
const CARRIER_MISSING: Shared = (
    &[
        "sensor open or stuck",
        "phase of the motor open",
        "injection.amplitude_v or the leakage inductances in motor.* not those of this motor",
    ],
    "check sensor and motor cable, then the settings",
);
const NOT_FINITE: Shared = (
    &["a flipped bit, or a defect in the firmware: the console takes finite numbers only"],
    "clear and start again; report it if it repeats",
);
const OFFSET: Shared = (
    &[
        "scales.current_* wrong for this board",
        "sensor or its supply faulty",
        "current in a motor that still turns",
    ],
    "let the motor come to rest; correct the offsets in scales.current_*",
);
const POLARITY: Shared = (
    &["sensor mounted or wired the wrong way round"],
    "turn the sensor round; a gain cannot be negative",
);
const THERMISTOR: Shared = (
    &[
        "wire or connector of the thermistor open",
        "wires of the thermistor shorted, or its pin at the supply",
        "scales.ntc.to_ground or scales.ntc.divider_ohm wrong",
    ],
    "measure the thermistor at its connector",
);
const NOISE: Shared = (
    &[
        "sensor lines not shielded or badly grounded, or a disturbed supply of the sensors",
        "injection.amplitude_v too small",
        "injection.flux_saliency smaller than the motor's, which makes the watch stricter than needed",
    ],
    "shield and ground the sensor lines, or raise injection.amplitude_v",
);

faults! {
    OverCurrentA = 1, "over-current in phase a", OVER_CURRENT.0, OVER_CURRENT.1;
    OverCurrentB = 2, "over-current in phase b", OVER_CURRENT.0, OVER_CURRENT.1;
    OverCurrentC = 3, "over-current in phase c, computed as -(a + b)", OVER_CURRENT.0, OVER_CURRENT.1;
    DcLinkOverVoltage = 4, "dc link above its limit",
        &[
            "the drive brakes and returns energy to the dc link",
            "inverter.dc_link_v or limits.dc_over_v not those of this supply",
            "scales.dc_link wrong: compare status with a voltmeter",
        ],
        "lower speed.ramp_rpm_per_s or the braking torque, or fit a brake resistor; set the limits of the supply";
    DcLinkUnderVoltage = 5, "dc link below its limit",
        &[
            "supply off, fuse blown, or precharge not finished",
            "supply too weak for the load",
            "inverter.dc_link_v or limits.dc_under_v not those of this supply",
            "scales.dc_link wrong: compare status with a voltmeter",
        ],
        "check the supply, reduce the torque; for a first test at low voltage lower limits.dc_under_v";
    OverSpeed = 6, "speed above its limit",
        &[
            "the load drives the shaft, or a constant torque accelerates a free one",
            "without encoder and observer: faster than injection.tracked_rpm, where the angle is tracked",
            "scales.encoder_counts or motor.pole_pairs wrong",
        ],
        "use the speed mode; for higher speeds set observer.enabled, or use the encoder";
    SensorSaturatedA = 7, "current sensor a at the end of its range, shorted or open", SENSOR_RANGE.0, SENSOR_RANGE.1;
    SensorSaturatedB = 8, "current sensor b at the end of its range, shorted or open", SENSOR_RANGE.0, SENSOR_RANGE.1;
    CarrierMissingA = 9, "no carrier current in sensor a where there must be some: open or stuck", CARRIER_MISSING.0, CARRIER_MISSING.1;
    CarrierMissingB = 10, "no carrier current in sensor b where there must be some: open or stuck", CARRIER_MISSING.0, CARRIER_MISSING.1;
    CurrentNotAsPredicted = 11, "measured current does not follow the applied voltage",
        &[
            "a current sensor that is stuck or scaled wrongly, or an open phase",
            "wrong flux angle at speed; with the encoder: lost counts, wrong scales.encoder_counts or direction",
            "motor.* or inverter.dead_time_s wrong",
        ],
        "correct sensors and settings before you raise limits.unexplained_v";
    LostAngle = 12, "the flux angle is lost",
        &[
            "a demodulator other than synchronous; literal cannot track",
            "injection.k_s or injection.z_s wrong",
        ],
        "use injection.demodulator synchronous";
    NonFiniteSettings = 13, "a setting is not a finite number", NOT_FINITE.0, NOT_FINITE.1;
    NonFiniteCommand = 14, "a reference is not a finite number", NOT_FINITE.0, NOT_FINITE.1;
    NonFiniteState = 15, "a state of the control is not a finite number", NOT_FINITE.0, NOT_FINITE.1;
    OffsetA = 16, "offset of current sensor a out of range at start", OFFSET.0, OFFSET.1;
    OffsetB = 17, "offset of current sensor b out of range at start", OFFSET.0, OFFSET.1;
    OverTemperature = 18, "heat sink too hot",
        &[
            "overload, fan or air flow",
            "scales.ntc.* not those of the thermistor",
        ],
        "let it cool and check the fan; compare the temperature in status with the room";
    Encoder = 19, "encoder jumped or stood still as the rotor cannot",
        &[
            "cable, supply or connector of the encoder, or interference",
            "coupling of the encoder broken, or shaft blocked",
            "limits.speed_rpm or scales.encoder_counts wrong",
        ],
        "check encoder and cable";
    Break = 20, "the power stage pulled the break input",
        &[
            "the power stage reports a fault of its own",
            "dc link above the level of the comparator",
            "pull-up of the break input missing or too weak, or its wire off",
            "a fault inside the chip: lock-up, supply below 2.8 V, flash error",
        ],
        "find the cause in the power stage, then clear; the fault comes back as long as the input is low";
    AnalogWatchdog = 21, "over-current seen by the analog watchdog", OVER_CURRENT.0, OVER_CURRENT.1;
    DeadlineMiss = 22, "the control interrupt missed its deadline",
        &[
            "a debugger that halted the core",
            "a defect in the firmware: status shows the longest period and the latest start",
        ],
        "report it; the watchdog resets the chip";
    ConverterOverrun = 23, "a conversion was lost",
        &["a trigger was lost, or a converter stopped"],
        "clear and start again; if it repeats, suspect the chip or its supply";
    // 24 was a failure of the clock, which resets the chip.
    NoSaliency = 25, "too little saliency, or the shaft turns",
        &[
            "the shaft still turned",
            "the motor has too little saliency for the injection",
            "sequence.i_d or sequence.magnetise_s too small, so that the flux was not there",
            "injection.flux_saliency or motor.* of another motor",
        ],
        "let the shaft come to rest and start again; if it repeats at rest, use the encoder";
    LostLock = 26, "the flux is not where the tracked angle says",
        &[
            "at a start: the shaft was not at rest",
            "learned on another motor or with other settings, or not learned at all",
            "rotor much warmer than the settings say",
            "a load that accelerates the shaft against the torque of the drive",
            "sensor noise or dead-time residual too large for the carrier",
        ],
        "learn on this motor when it is warm; raise injection.amplitude_v, or use the encoder";
    ShaftNotLocked = 27, "the shaft moved, or the flux did not turn, while learning",
        &[
            "the shaft is not locked",
            "dead-time compensation off: inverter.compensate",
            "motor.r_r or motor.l_* far from the motor, so that the slip is too slow",
        ],
        "lock the shaft and learn again";
    NothingLearned = 28, "what was learned is not believable",
        &[
            "shaft not quite locked, interference, or a load that pulses",
            "motor.r_r wrong",
            "a motor without the saliency",
        ],
        "lock the shaft and learn again; nothing was changed";
    CarrierWeak = 29, "too little carrier current: open phase, or the inverter does not put it out",
        &[
            "open phase, or a leg of the inverter that does not switch",
            "injection.amplitude_v or the leakage inductances in motor.* not those of this motor",
        ],
        "check motor cable and gates, then the settings";
    WiringNoCurrent = 30, "wiring check: a sensor sees no current, it or a phase is open",
        &[
            "motor not connected, or a phase open",
            "sensor or its supply missing",
            "gates of a leg not connected",
        ],
        "check motor cable, sensors and gates";
    WiringPolarityA = 31, "wiring check: current sensor a is the wrong way round", POLARITY.0, POLARITY.1;
    WiringPolarityB = 32, "wiring check: current sensor b is the wrong way round", POLARITY.0, POLARITY.1;
    WiringExchanged = 33, "wiring check: current sensors or gates are on the wrong phases",
        &[
            "the two sensors are exchanged",
            "gates and sensors are not in the same order",
        ],
        "exchange the sensors, or bring gates and sensors into the same order";
    WiringCurrent = 34, "wiring check: more current than the motor's settings explain",
        &[
            "motor.l_ls, motor.l_lr or motor.l_m too large",
            "short circuit in motor or cable",
            "scales.current_* or scales.dc_link wrong",
        ],
        "set the parameters of this motor; measure its insulation";
    CarrierNoRoom = 35, "the voltage left by the fundamental is too small for the carrier",
        &[
            "dc link too low for speed and torque",
            "injection.amplitude_v too large",
            "at the start: phase of the motor open",
        ],
        "check the motor cable; lower injection.amplitude_v, the speed or the torque";
    SensorNoisyA = 36, "current sensor a is too noisy for the injection", NOISE.0, NOISE.1;
    SensorNoisyB = 37, "current sensor b is too noisy for the injection", NOISE.0, NOISE.1;
    SensorSaturatedC = 38, "current sensor c at the end of its range, shorted or open", SENSOR_RANGE.0, SENSOR_RANGE.1;
    OffsetC = 39, "offset of current sensor c out of range at start", OFFSET.0, OFFSET.1;
    CurrentSum = 40, "the three phase currents do not sum to zero",
        &[
            "gain of a shunt or of its amplifier wrong: scales.current_*",
            "earth fault in motor or cable",
            "scales.shunt_settle_s too short for the amplifiers",
        ],
        "disconnect the motor and measure its insulation, then compare the three currents in status";
    FluxNotAsPredicted = 41, "the voltage of the flux is not that of the tracked angle and flux",
        &[
            "the tracked angle is wrong, or the flux is gone",
            "motor.l_m, motor.r_s or motor.pole_pairs wrong",
            "inverter.dead_time_s wrong",
        ],
        "as for fault 26: learn on this motor; correct motor.*, or use the encoder";
    SlopeTooSmall = 42, "the saliency changes too little with the angle to be tracked",
        &[
            "too little flux: sequence.i_d",
            "a motor without enough saliency, or one whose sign changes with the load",
        ],
        "learned shows the slope and what is needed; raise sequence.i_d and learn again, or use the encoder";
    MotorOverload = 43, "the motor has carried too much current for too long",
        &[
            "more torque, or more flux, than the motor bears for ever",
            "limits.motor_a or limits.motor_s not those of the motor",
        ],
        "let the motor cool; reduce the torque, or sequence.i_d";
    InverterOverload = 44, "the inverter has carried too much current for too long",
        &[
            "more current than the power stage bears for ever",
            "limits.inverter_a or limits.inverter_s not those of the power stage",
        ],
        "let it cool; reduce the torque, or sequence.i_d";
    ThermistorOpen = 45, "thermistor of the heat sink open: colder than -40 degC", THERMISTOR.0, THERMISTOR.1;
    ThermistorShorted = 46, "thermistor of the heat sink shorted: hotter than 200 degC", THERMISTOR.0, THERMISTOR.1;
    NotCaught = 47, "the turning shaft was not caught",
        &[
            "the shaft turns too fast: beyond 2700 rpm of four poles",
            "flux left from the run before, or a load that changes the speed quickly",
            "motor.* of another motor",
        ],
        "let the shaft slow down, then clear and start again";
    Stalled = 48, "the motor stays at its current limit and hardly turns",
        &[
            "shaft blocked, or a load beyond the torque that the current limit allows",
            "nameplate.* of another motor",
            "speed.ramp_rpm_per_s too steep for the inertia",
        ],
        "free the shaft, or reduce the load; raise limits.current_a if motor and inverter bear it";
    ChopperOff = 49, "the chip has switched the brake chopper off",
        &[
            "supply of the controller below 2.8 V for a moment",
            "an error in the flash, or a flipped bit in the timer of the chopper",
        ],
        "check the supply of the controller, then clear: the chopper comes back once the cause is gone";
    WrongClock = 50, "the core clock and the clock of the watchdog do not agree",
        &["crystal damaged or of another frequency", "a chip far beyond its temperature, or damaged"],
        "check the crystal of the controller: 24 MHz; if it is right, replace the controller";
    WrongReference = 51, "the reference voltage of the converters is wrong",
        &["supply of the controller, or what feeds VREF+, more than 3 % off", "chip damaged"],
        "measure the 3.3 V at VDDA and VREF+, then clear";
}

impl Fault {
    /// Number of the fault.
    pub const fn code(self) -> u8 {
        self as u8
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

#[cfg(test)]
mod tests;
