//! The plant that the drive is connected to: motor, shaft, inverter, sensors and encoder, in `f64`.
//!
//! One call of [`Plant::advance`] is one PWM period. The caller keeps the delay convention of
//! [`drive_core::io`]: the output computed from the sample at `k T` is applied from
//! `(k + 1) T` on, except that outputs that go off do so at once:
//!
//! ```no_run
//! use drive_core::Compare;
//! use motor_plant::{Plant, PlantSettings};
//! # fn step(_: &drive_core::Sample) -> Compare { Compare::OFF }
//!
//! let mut plant = Plant::new(&PlantSettings::default(), 1)?;
//! let mut applied = Compare::OFF;
//! for _ in 0..6000 {
//!     let next = step(&plant.sample());
//!     applied.enabled &= next.enabled;
//!     plant.advance(&applied, 1.0 / 6000.0);
//!     applied = next;
//! }
//! # Ok::<(), motor_plant::PlantError>(())
//! ```

mod averaged;
mod complex;
mod encoder;
mod error;
mod freewheel;
mod integrate;
mod inverter;
mod machine;
mod mechanics;
mod sensors;
mod switched;

use drive_core::{Compare, Hardware, Sample};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

pub use complex::{Complex, clarke, phases};
pub use encoder::{Encoder, EncoderFault, EncoderSettings};
pub use error::PlantError;
pub use integrate::{MotorModel, MotorState};
pub use inverter::{Inverter, InverterSettings};
pub use machine::{Machine, MachineSettings, MachineState, SaliencySettings};
pub use mechanics::{Load, Mechanics, MechanicsSettings};
pub use sensors::{CalibrationLine, Channel, CurrentFault, MeasurementSettings, Sensors};

/// Integration steps per period while the outputs are off: at most this fraction of the period.
const FREEWHEEL_SUBSTEPS: u32 = 8;

/// Settings of the plant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlantSettings {
    /// Parameters of the machine.
    pub machine: MachineSettings,
    /// Its saliency.
    pub saliency: SaliencySettings,
    /// The shaft and its load.
    pub mechanics: MechanicsSettings,
    /// The inverter.
    pub inverter: InverterSettings,
    /// The current sensors and the converter.
    pub measurement: MeasurementSettings,
    /// The encoder.
    pub encoder: EncoderSettings,
    /// Integration steps per PWM period. Two, the default, are within 1e-5 A of 24, and the analog
    /// filter takes the current as straight between them.
    pub substeps: u32,
}

impl Default for PlantSettings {
    fn default() -> Self {
        Self {
            machine: MachineSettings::default(),
            saliency: SaliencySettings::default(),
            mechanics: MechanicsSettings::default(),
            inverter: InverterSettings::default(),
            measurement: MeasurementSettings::default(),
            encoder: EncoderSettings::default(),
            substeps: 2,
        }
    }
}

/// The plant.
#[derive(Clone, Debug)]
pub struct Plant {
    motor: MotorModel,
    inverter: Inverter,
    sensors: Sensors,
    encoder: Encoder,
    rng: Xoshiro256PlusPlus,
    substeps: u32,
    applied: Complex,
    hardware: Hardware,
}

impl Plant {
    /// The plant at rest, without currents and flux. Equal settings and seeds give equal plants, to
    /// the bit.
    ///
    /// # Errors
    /// [`PlantError`] with the setting that is refused.
    pub fn new(settings: &PlantSettings, seed: u64) -> Result<Self, PlantError> {
        error::check("substeps", f64::from(settings.substeps), 1.0..=1000.0, "")?;
        let machine = Machine::new(&settings.machine, &settings.saliency)?;
        let mechanics = Mechanics::new(&settings.mechanics)?;
        Ok(Self {
            motor: MotorModel::new(machine, mechanics),
            inverter: Inverter::new(&settings.inverter)?,
            sensors: Sensors::new(&settings.measurement)?,
            encoder: Encoder::new(&settings.encoder)?,
            rng: Xoshiro256PlusPlus::seed_from_u64(seed),
            substeps: settings.substeps,
            applied: Complex::ZERO,
            hardware: Hardware::empty(),
        })
    }

    /// The present readings of converters, counter and hardware. Each call draws new noise and clears the
    /// reported hardware events.
    #[inline]
    pub fn sample(&mut self) -> Sample {
        let [current_a, current_b] = self.sensors.currents(&mut self.rng);
        Sample {
            current_a,
            current_b,
            // Two sensors.
            current_c: 0,
            dc_link: self.sensors.dc_link(self.inverter.vdc),
            heat_sink: self.sensors.heat_sink(),
            encoder: self.encoder.count(),
            hardware: std::mem::take(&mut self.hardware),
        }
    }

    /// One PWM period of `period_s` seconds with these compare values, delayed already.
    #[inline]
    pub fn advance(&mut self, compare: &Compare, period_s: f64) {
        let volt_seconds = if !compare.enabled {
            self.freewheel(period_s)
        } else if self.inverter.switched {
            self.switched(compare, period_s)
        } else {
            self.averaged(compare, period_s)
        };
        self.applied = volt_seconds / period_s;
        self.inverter.previous = *compare;
        self.encoder.follow(self.motor.state.angle);
    }

    #[inline]
    fn averaged(&mut self, compare: &Compare, period: f64) -> Complex {
        let averaged = self.inverter.averaged(compare, period);
        let h = period / f64::from(self.substeps);
        let mut volt_seconds = Complex::ZERO;
        for _ in 0..self.substeps {
            let before = self.motor.state.electrical.i;
            volt_seconds += averaged.step(&mut self.motor, h);
            self.sensors.follow(before, self.motor.state.electrical.i, h);
        }
        volt_seconds
    }

    fn switched(&mut self, compare: &Compare, period: f64) -> Complex {
        let pattern = switched::Pattern::new(&self.inverter, compare, period);
        let longest = period / f64::from(self.substeps);
        let mut volt_seconds = Complex::ZERO;
        for (duration, levels) in pattern.pieces() {
            let steps = (duration / longest).ceil().max(1.0);
            let h = duration / steps;
            for _ in 0..steps as u32 {
                let (machine, inverter) = (&self.motor.machine, &self.inverter);
                let i = self.motor.state.electrical.i;
                let legs = switched::leg_voltages(levels, i, inverter.vdc);
                let (state, v) = self.motor.stepped(h, |x, w| {
                    let v = inverter.dropped(legs, x.i);
                    (machine.derivative(x, v, w), v)
                });
                volt_seconds += v * h;
                self.sensors.follow(i, state.electrical.i, h);
                self.motor.state = state;
            }
        }
        volt_seconds
    }

    fn freewheel(&mut self, period: f64) -> Complex {
        let substeps = self.substeps.max(FREEWHEEL_SUBSTEPS);
        let h = period / f64::from(substeps);
        let mut volt_seconds = Complex::ZERO;
        for _ in 0..substeps {
            let before = self.motor.state.electrical.i;
            volt_seconds += freewheel::step(&mut self.motor, self.inverter.vdc, h);
            self.sensors.follow(before, self.motor.state.electrical.i, h);
        }
        volt_seconds
    }

    /// The motor: machine, shaft and their state.
    pub fn motor(&self) -> &MotorModel {
        &self.motor
    }

    /// Stator current, A, in the stator frame.
    pub fn current(&self) -> Complex {
        self.motor.state.electrical.i
    }

    /// Phase currents, A.
    pub fn phase_currents(&self) -> [f64; 3] {
        phases(self.current())
    }

    /// Rotor flux linkage, Wb, in the stator frame.
    pub fn rotor_flux(&self) -> Complex {
        self.motor.state.electrical.psi
    }

    /// True angle of the rotor flux, electrical rad, -pi to pi; 0 without flux.
    pub fn rotor_flux_angle(&self) -> f64 {
        self.rotor_flux().arg()
    }

    /// Electromagnetic torque, N m.
    pub fn torque(&self) -> f64 {
        self.motor.machine.torque(&self.motor.state.electrical)
    }

    /// Mechanical angle of the rotor, rad, not wrapped, 0 at the start.
    pub fn mechanical_angle(&self) -> f64 {
        self.motor.state.angle
    }

    /// Mechanical speed of the rotor, rad/s.
    pub fn mechanical_speed(&self) -> f64 {
        self.motor.state.speed
    }

    /// Line-to-neutral voltage at the terminals, V, averaged over the last period.
    pub fn applied_voltage(&self) -> Complex {
        self.applied
    }

    /// Dc-link voltage, V.
    pub fn dc_link(&self) -> f64 {
        self.inverter.vdc
    }

    /// Changes the dc-link voltage, V.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`] outside 0 to 1000 V.
    pub fn set_dc_link(&mut self, vdc: f64) -> Result<(), PlantError> {
        self.inverter.set_dc_link(vdc)
    }

    /// Changes the dead time, us.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`] outside 0 to 10 us.
    pub fn set_dead_time(&mut self, us: f64) -> Result<(), PlantError> {
        self.inverter.set_dead_time(us)
    }

    /// Couples another load. A held speed holds at once; a free shaft continues from there.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`] for its torque or speed.
    pub fn set_load(&mut self, load: Load) -> Result<(), PlantError> {
        self.motor.mechanics.set_load(load)?;
        self.motor.hold_speed();
        Ok(())
    }

    /// Changes the parameters of the machine and keeps its state (a warmer rotor, for example).
    ///
    /// # Errors
    /// As [`Machine::new`].
    pub fn set_machine(
        &mut self,
        machine: &MachineSettings,
        saliency: &SaliencySettings,
    ) -> Result<(), PlantError> {
        self.motor.machine = Machine::new(machine, saliency)?;
        Ok(())
    }

    /// Turns the rotor flux by an angle, electrical rad, at once: an estimate of the flux angle is then
    /// wrong by as much.
    pub fn turn_rotor_flux(&mut self, angle: f64) {
        let turn = Complex::new(angle.cos(), angle.sin());
        let electrical = &mut self.motor.state.electrical;
        electrical.psi *= turn;
    }

    /// Sets the fault of a current channel.
    pub fn set_current_fault(&mut self, channel: Channel, fault: CurrentFault) {
        self.sensors.set_fault(channel, fault);
    }

    /// Sets the fault of the encoder.
    pub fn set_encoder_fault(&mut self, fault: EncoderFault) {
        self.encoder.fault = fault;
    }

    /// Changes the code of the heat-sink temperature.
    pub fn set_heat_sink(&mut self, code: u16) {
        self.sensors.set_heat_sink(code);
    }

    /// Adds events to those that the next sample reports.
    pub fn report(&mut self, events: Hardware) {
        self.hardware = self.hardware.union(events);
    }
}
