//! The words that keys of the bench may have as values.

use drive_settings::value::Words;
use drive_settings::words;

use super::value::{Allowed, Field, Value};

/// Words that are values of keys.
macro_rules! words_of_keys {
    ($($(#[$about:meta])* pub enum $type:ident { $($words:tt)+ })+) => {$(
        words! { $(#[$about])* pub enum $type { $($words)+ } }

        impl Field for $type {
            fn to_value(&self) -> Value {
                Value::Word(self.word().to_owned())
            }

            fn from_value(value: &Value, _: &Allowed) -> Result<Self, &'static str> {
                let is = |word: &&str| matches!(value, Value::Word(given) if given == word);
                let place = Self::WORDS.iter().position(is);
                place.map(Self::at).ok_or("not one of the words")
            }
        }
    )+};
}

words_of_keys! {
    /// Load on the shaft.
    pub enum LoadMode {
        /// Shaft blocked.
        Locked = "locked",
        /// Turns freely against `load.torque_nm`.
        Free = "free",
        /// A dynamometer holds `load.speed_rpm`.
        Speed = "speed",
    }

    /// Model of the motor: model A with its assumed saliency, or a family of iron from which saliency emerges.
    pub enum PlantModel {
        /// Model A.
        A = "a",
        /// Energy model, linear iron.
        Linear = "linear",
        /// Teeth fixed to the rotor flux, -3.5 %.
        R = "r",
        /// Teeth fixed to the rotor flux, -5 %.
        R5 = "r5",
        /// Teeth fixed to the air-gap flux, -3.5 %.
        G = "g",
        /// Teeth fixed to the air-gap flux, -7 %.
        G7 = "g7",
        /// As r; both leakages saturate as measured at a start.
        Rl = "rl",
        /// As g; both leakages saturate as measured at a start.
        Gl = "gl",
        /// Main flux, n = 4.
        M4 = "m4",
        /// Main flux, n = 6.
        M6 = "m6",
        /// Main flux, n = 4, and stator leakage.
        M4b = "m4b",
        /// Main flux, n = 6, and stator leakage.
        M6b = "m6b",
        /// Teeth, main flux, leakages and skin effect.
        F = "f",
    }

    /// Flux at which the numbers of a family hold.
    pub enum FluxLevel {
        /// That of a direct current of 0.7 A with the dissertation's motor, in proportion to the rated current.
        Low = "low",
        /// The smaller of the rated flux and that of 0.55 times the peak of the rated current.
        High = "high",
    }

    /// Which runs the battery consists of.
    pub enum BatteryRuns {
        /// The twelve kinds.
        Kinds = "kinds",
        /// Load steps of battery.load_share.
        Load = "load",
        /// Torque near its largest at rest.
        Hold = "hold",
        /// The flux turned at once.
        Forced = "forced",
        /// Torque commands that never rest.
        Restless = "restless",
        /// The shaft dragged through zero stator frequency under torque.
        Dragged = "dragged",
    }

    /// What the drive is asked for in runs over the whole speed range.
    pub enum RangeKind {
        /// Constant torque at constant speed.
        Constant = "constant",
        /// Steps of the torque between its limits at constant speed.
        Reversals = "reversals",
        /// Load steps at a regulated speed.
        LoadSteps = "load-steps",
        /// Ramps of the speed through zero.
        Ramps = "ramps",
        /// The same, and the motor warms up on the way.
        HotRamps = "hot-ramps",
        /// Constant torque with a drive that is wrong about its motor.
        WrongParameters = "wrong-parameters",
        /// The flux turned at once under constant torque.
        TurnedFlux = "turned-flux",
        /// Start on a turning shaft without flux.
        TurningStart = "turning-start",
        /// The same soon after a stop, with flux left.
        ResidualStart = "residual-start",
        /// Stop of a large inertia on a dc link that takes no energy back.
        Braking = "braking",
        /// Mains outage.
        Outage = "outage",
        /// Sag of the dc link under torque.
        Sag = "sag",
    }

    /// A phase that is interrupted between inverter and motor.
    pub enum OpenPhase {
        /// None.
        None = "none",
        /// Phase a.
        A = "a",
        /// Phase b.
        B = "b",
        /// Phase c.
        C = "c",
    }
}
