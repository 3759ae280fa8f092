//! The shaft: inertia, friction and load; with an elastic coupling, a second inertia.
//!
//! Static friction and the torque of the coupling are constant within an integration step, and a torque that varies
//! once per revolution is constant within a PWM period. The shaft is therefore of first order in these torques.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};
use crate::settings::{or_zero, settings};

/// Load on the shaft.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, tag = "mode", rename_all = "snake_case")]
pub enum Load {
    /// The shaft turns freely against this torque.
    Free {
        /// Load torque, N m; positive brakes a positive speed and drives a negative one.
        torque: f64,
    },
    /// The shaft is locked.
    Locked,
    /// A dynamometer holds the speed against any torque.
    Speed {
        /// Mechanical speed, rad/s.
        speed: f64,
    },
}

settings! {
    /// Inertia, friction and load.
    MechanicsSettings "mechanics." |s| {
        /// Inertia of all rotating parts, kg m^2. The default is assumed: the source gives none.
        inertia: f64 = 0.012, 1e-6..=1000.0, "kg m^2";
        /// Viscous friction, N m s/rad. The default is assumed: the source gives none.
        friction: f64 = 0.001, 0.0..=10.0, "N m s/rad";
        /// Static friction: the breakaway torque, and the same torque against the motion, N m.
        static_torque: f64 = 0.0, 0.0..=1000.0, "N m";
        /// Amplitude of a load torque that varies once per revolution with the cosine of the rotor angle, N m.
        once_torque: f64 = 0.0, 0.0..=1000.0, "N m";
        /// Distance of the stops on both sides from angle 0, mechanical rad; 0 for no stops.
        stops: f64 = 0.0, 0.0..=1e4, "rad";
        /// Stiffness of a stop, N m/rad. Its resonance with the inertia may be 100 Hz at most, because the torque is
        /// constant within a PWM period.
        stop_stiffness: f64 = 100.0, 0.0..=(s.inertia * 628.0 * 628.0).max(100.0), "N m/rad";
        /// Damping of a stop, N m s/rad: with the other defaults the shaft rebounds with 0.65 of its speed.
        stop_damping: f64 = 0.3, 0.0..=1000.0, "N m s/rad";
        /// Inertia behind an elastic coupling, where the load acts, kg m^2; 0 for a rigid shaft.
        load_inertia: f64 = 0.0, or_zero(s.load_inertia, 1e-6..=1000.0), "kg m^2";
        /// Stiffness of the coupling, N m/rad.
        stiffness: f64 = 100.0, 1e-3..=s.stiffest(), "N m/rad";
        /// Damping of the coupling, N m s/rad.
        damping: f64 = 0.0, 0.0..=1000.0, "N m s/rad";
        /// Load at the start.
        load: Load = Load::Free { torque: 0.0 };
    }
}

impl MechanicsSettings {
    /// Largest stiffness of the coupling, N m/rad: a resonance of at most 500 Hz, which the integration can follow.
    fn stiffest(&self) -> f64 {
        let parallel = self.inertia * self.load_inertia / (self.inertia + self.load_inertia);
        if self.load_inertia > 0.0 { parallel * 3141.0 * 3141.0 } else { 1e9 }
    }
}

/// Coefficients of the equation of motion, `J dw/dt = Te - TL - B w`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanics {
    settings: MechanicsSettings,
    load: Load,
    load_torque: f64,
    /// 1/J if the shaft is free, otherwise 0.
    mobility: f64,
    extras: Option<Extras>,
}

/// Effects that most shafts do not have, with their state.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Extras {
    coupling: Option<Coupling>,
    /// Torque that depends on the angle, in this period.
    by_angle: f64,
    /// Speed at the start of the step; also 0 while friction holds the shaft.
    speed: f64,
}

impl Extras {
    /// Torque of the stop that the shaft has reached: it pushes, but does not pull.
    fn stop_torque(&self, s: &MechanicsSettings, angle: f64) -> f64 {
        let beyond = angle.abs() - s.stops;
        if s.stops == 0.0 || beyond <= 0.0 {
            return 0.0;
        }
        let outwards = self.speed * angle.signum();
        (s.stop_stiffness * beyond + s.stop_damping * outwards).max(0.0) * angle.signum()
    }
}

/// The elastic coupling and the inertia behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Coupling {
    twist: f64,
    speed: f64,
    /// Torque that the coupling takes from the motor in this step.
    torque: f64,
}

impl Mechanics {
    /// Makes the shaft with these settings.
    ///
    /// # Errors
    /// [`PlantError`].
    pub fn new(s: &MechanicsSettings) -> Result<Self, PlantError> {
        s.check()?;
        let coupling = (s.load_inertia > 0.0).then(Coupling::default);
        let plain =
            coupling.is_none() && (s.static_torque, s.once_torque, s.stops) == (0.0, 0.0, 0.0);
        let extras = Extras { coupling, by_angle: 0.0, speed: 0.0 };
        let mut mechanics = Self {
            settings: *s,
            load: Load::Locked,
            load_torque: 0.0,
            mobility: 0.0,
            extras: (!plain).then_some(extras),
        };
        mechanics.set_load(s.load)?;
        Ok(mechanics)
    }

    /// Couples another load.
    ///
    /// # Errors
    /// [`PlantError`] for its torque or speed.
    pub fn set_load(&mut self, load: Load) -> Result<(), PlantError> {
        match load {
            Load::Free { torque } => {
                check("mechanics.load.torque", torque, -1000.0..=1000.0, "N m")?;
                self.load_torque = torque;
                self.mobility = 1.0 / self.settings.inertia;
            }
            Load::Locked => self.mobility = 0.0,
            Load::Speed { speed } => {
                check("mechanics.load.speed", speed, -4000.0..=4000.0, "rad/s")?;
                self.mobility = 0.0;
            }
        }
        self.load = load;
        Ok(())
    }

    /// The present load.
    pub fn load(&self) -> Load {
        self.load
    }

    /// Returns the speed that the load imposes, mechanical rad/s; none with a free shaft.
    pub fn held_speed(&self) -> Option<f64> {
        match self.load {
            Load::Free { .. } => None,
            Load::Locked => Some(0.0),
            Load::Speed { speed } => Some(speed),
        }
    }

    /// Returns the acceleration, rad/s^2, caused by the electromagnetic `torque` at this mechanical speed.
    #[inline]
    pub fn acceleration(&self, torque: f64, speed: f64) -> f64 {
        (torque - self.load_torque - self.settings.friction * speed) * self.mobility
    }

    /// Returns the mechanical speed of the inertia behind the elastic coupling, rad/s; none with a rigid shaft.
    pub fn load_speed(&self) -> Option<f64> {
        self.extras?.coupling.map(|coupling| coupling.speed)
    }

    /// Whether anything besides inertia, viscous friction and a constant load acts.
    #[inline]
    pub(crate) fn has_extras(&self) -> bool {
        self.extras.is_some()
    }

    /// Sets the torques that depend on the angle, for a period that begins at this angle of the rotor.
    #[inline]
    pub(crate) fn begin_period(&mut self, angle: f64) {
        if let Some(extras) = &mut self.extras {
            let s = &self.settings;
            extras.by_angle = s.once_torque * angle.cos() + extras.stop_torque(s, angle);
        }
    }

    /// Sets the torques of an integration step that begins at this speed and electromagnetic torque. Returns the speed,
    /// or zero if friction holds the shaft.
    #[inline(never)]
    pub(crate) fn begin(&mut self, speed: f64, torque: f64) -> f64 {
        let (Load::Free { torque: load }, Some(extras)) = (self.load, &mut self.extras) else {
            return speed;
        };
        let (s, at_load) = (&self.settings, load + extras.by_angle);
        let against = extras.coupling.as_mut().map_or(at_load, |coupling| {
            coupling.torque = s.stiffness * coupling.twist + s.damping * (speed - coupling.speed);
            coupling.torque
        });
        // A shaft that has come to rest, or has passed through zero speed, stays there if friction can hold it.
        let rests = speed == 0.0 || extras.speed * speed < 0.0;
        let driven = torque - against;
        extras.speed = speed;
        self.mobility = 1.0 / self.settings.inertia;
        self.load_torque = against;
        if s.static_torque > 0.0 {
            if rests && driven.abs() <= s.static_torque {
                extras.speed = 0.0;
                self.mobility = 0.0;
                return 0.0;
            }
            let direction = if rests { driven } else { speed };
            self.load_torque += s.static_torque.copysign(direction);
        }
        speed
    }

    /// Ends an integration step of `h` seconds: updates the inertia behind the coupling.
    pub(crate) fn end(&mut self, speed: f64, h: f64) {
        let (Load::Free { torque: load }, Some(extras)) = (self.load, &mut self.extras) else {
            return;
        };
        if let Some(coupling) = &mut extras.coupling {
            coupling.speed +=
                h * (coupling.torque - load - extras.by_angle) / self.settings.load_inertia;
            coupling.twist += h * (speed - coupling.speed);
        }
    }
}
