//! The words that are values of keys of the bench.

use drive_settings::value::Words;
use drive_settings::words;

words! {
    /// Load on the shaft.
    pub enum LoadMode {
        /// Shaft blocked.
        Locked = "locked",
        /// The shaft turns freely against `load.torque_nm`.
        Free = "free",
        /// A dynamometer holds `load.speed_rpm`.
        Speed = "speed",
    }

    /// Model of the motor: model A with its assumed saliency, or a saturation model from which saliency emerges.
    pub enum PlantModel {
        /// Model A.
        A = "a",
        /// Energy model with linear iron.
        Linear = "linear",
        /// Teeth fixed to the rotor flux, -3.5 %.
        R = "r",
        /// Teeth fixed to the rotor flux, -5 %.
        R5 = "r5",
        /// Teeth fixed to the air-gap flux, -3.5 %.
        G = "g",
        /// Teeth fixed to the air-gap flux, -7 %.
        G7 = "g7",
        /// As `r`; both leakage inductances saturate as measured at a start.
        Rl = "rl",
        /// As `g`; both leakage inductances saturate as measured at a start.
        Gl = "gl",
        /// Saturation of the main flux, n = 4.
        M4 = "m4",
        /// Saturation of the main flux, n = 6.
        M6 = "m6",
        /// Saturation of the main flux, n = 4, and of the stator leakage.
        M4b = "m4b",
        /// Saturation of the main flux, n = 6, and of the stator leakage.
        M6b = "m6b",
        /// Teeth, main flux, leakage inductances and skin effect.
        F = "f",
    }

    /// Flux at which the numbers of a saturation model hold.
    pub enum FluxLevel {
        /// The flux of a magnetising current of 0.7 A with the dissertation's motor, in proportion to the rated current.
        Low = "low",
        /// The smaller of the rated flux and the flux of 0.55 times the peak of the rated current.
        High = "high",
    }

    /// Kind of runs of the stress test.
    pub enum BatteryRuns {
        /// The twelve kinds.
        Kinds = "kinds",
        /// Load steps of `battery.load_share`.
        Load = "load",
        /// Torque near its maximum at standstill.
        Hold = "hold",
        /// A sudden rotation of the flux.
        Forced = "forced",
        /// Dithered torque commands.
        Restless = "restless",
        /// A shaft that is driven through zero stator frequency under torque.
        Dragged = "dragged",
        /// A shaft that is driven through zero stator frequency under torque. An asymmetry arises after the start.
        Arising = "arising",
    }

    /// Task of the drive in runs over the whole speed range.
    pub enum RangeKind {
        /// Every one of the tasks below.
        All = "all",
        /// Constant torque at constant speed.
        Constant = "constant",
        /// Torque steps between the torque limits at constant speed.
        Reversals = "reversals",
        /// Load steps while the speed is regulated.
        LoadSteps = "load-steps",
        /// Speed ramps through zero.
        Ramps = "ramps",
        /// Speed ramps through zero while the motor warms up.
        HotRamps = "hot-ramps",
        /// Constant torque with wrong motor parameters in the drive.
        WrongParameters = "wrong-parameters",
        /// A sudden rotation of the flux under constant torque.
        TurnedFlux = "turned-flux",
        /// Flying start without flux.
        TurningStart = "turning-start",
        /// Flying start soon after a stop, with residual flux.
        ResidualStart = "residual-start",
        /// Stop of a large inertia on a dc link that cannot feed energy back.
        Braking = "braking",
        /// Mains outage.
        Outage = "outage",
        /// Sag of the dc link under torque.
        Sag = "sag",
    }

    /// Phase that is interrupted between inverter and motor.
    pub enum OpenPhase {
        /// No phase.
        None = "none",
        /// Phase a.
        A = "a",
        /// Phase b.
        B = "b",
        /// Phase c.
        C = "c",
    }
}
