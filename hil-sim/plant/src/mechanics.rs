//! The shaft: inertia, friction and load.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};

/// Load on the shaft.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, tag = "mode", rename_all = "snake_case")]
pub enum Load {
    /// The shaft turns freely against this torque.
    Free {
        /// Load torque, N m; positive brakes a positive speed and drives a negative one.
        torque: f64,
    },
    /// The shaft is blocked.
    Locked,
    /// A dynamometer holds the speed, whatever the torque.
    Speed {
        /// Mechanical speed, rad/s.
        speed: f64,
    },
}

/// Inertia, friction and load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MechanicsSettings {
    /// Inertia of everything that turns, kg m^2. The default is assumed: the source gives none.
    pub inertia: f64,
    /// Viscous friction, N m s/rad. The default is assumed: the source gives none.
    pub friction: f64,
    /// Load at the start.
    pub load: Load,
}

impl Default for MechanicsSettings {
    fn default() -> Self {
        Self { inertia: 0.012, friction: 0.001, load: Load::Free { torque: 0.0 } }
    }
}

/// Coefficients of the equation of motion, `J dw/dt = Te - TL - B w`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanics {
    inertia: f64,
    friction: f64,
    load: Load,
    load_torque: f64,
    /// 1/J when the shaft is free, else 0.
    mobility: f64,
}

impl Mechanics {
    /// The shaft with these settings.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`].
    pub fn new(settings: &MechanicsSettings) -> Result<Self, PlantError> {
        check("mechanics.inertia", settings.inertia, 1e-6..=1000.0, "kg m^2")?;
        check("mechanics.friction", settings.friction, 0.0..=10.0, "N m s/rad")?;
        let mut mechanics = Self {
            inertia: settings.inertia,
            friction: settings.friction,
            load: Load::Locked,
            load_torque: 0.0,
            mobility: 0.0,
        };
        mechanics.set_load(settings.load)?;
        Ok(mechanics)
    }

    /// Couples another load.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`] for its torque or speed.
    pub fn set_load(&mut self, load: Load) -> Result<(), PlantError> {
        match load {
            Load::Free { torque } => {
                check("mechanics.load.torque", torque, -1000.0..=1000.0, "N m")?;
                self.load_torque = torque;
                self.mobility = 1.0 / self.inertia;
            }
            Load::Locked => self.mobility = 0.0,
            Load::Speed { speed } => {
                check("mechanics.load.speed", speed, -2000.0..=2000.0, "rad/s")?;
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

    /// The speed that the load imposes, mechanical rad/s; none with a free shaft.
    pub fn held_speed(&self) -> Option<f64> {
        match self.load {
            Load::Free { .. } => None,
            Load::Locked => Some(0.0),
            Load::Speed { speed } => Some(speed),
        }
    }

    /// Acceleration, rad/s^2, by the electromagnetic `torque` at this mechanical speed.
    #[inline]
    pub fn acceleration(&self, torque: f64, speed: f64) -> f64 {
        (torque - self.load_torque - self.friction * speed) * self.mobility
    }
}
