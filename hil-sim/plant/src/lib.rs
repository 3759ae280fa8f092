//! The plant that the drive is connected to: motor, shaft, inverter, sensors and encoder, in `f64`.
//!
//! One call of [`Plant::period`] is one PWM period of a drive, with the delay convention of [`drive_core::io`]:
//!
//! ```no_run
//! use drive_core::{Compare, Output, Sample};
//! use motor_plant::{Plant, PlantSettings};
//! # fn control(_: &Sample) -> (Compare, Output) { (Compare::OFF, Output::default()) }
//!
//! let mut plant = Plant::new(&PlantSettings::DEFAULT, 1)?;
//! for _ in 0..6000 {
//!     let (compare, output) = control(&plant.sample());
//!     plant.period(&compare, &output);
//! }
//! # Ok::<(), motor_plant::PlantError>(())
//! ```

// The inline hints stand where measurements justify them, in nanoseconds a period. Without the hints of machine, model
// and mechanics, model A takes 339 instead of 279; without the hints here and in model, 284. Without those of the
// energy model and the switched edges, all effects together take 780 instead of 731. A hint is `always` where the
// compiler did not follow a plain one (the derivative of model A: 2330 instead of 2170 with switched edges).
mod averaged;
mod complex;
mod dc_link;
mod encoder;
mod energy;
mod error;
mod freewheel;
mod integrate;
mod inverter;
mod machine;
mod mechanics;
mod model;
mod motor;
mod period;
mod sensors;
mod settings;
mod switched;
mod terminals;
mod warming;

use dc_link::DcLink;
use drive_core::io::PERIOD_S;
use drive_core::{Compare, Hardware, Output, Sample};
use motor::{Motor, whichever};
use period::Around;
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use settings::settings;
use warming::Warming;

pub use complex::{Complex, clarke, phases};
pub use dc_link::DcLinkSettings;
pub use encoder::{Encoder, EncoderFault, EncoderSettings};
pub use energy::{EnergyMachine, EnergyRate, EnergyState, FAMILIES, Family, IronSettings};
pub use error::PlantError;
pub use integrate::{MotorModel, MotorState};
pub use inverter::{Inverter, InverterSettings};
pub use machine::{Machine, MachineSettings, MachineState, SaliencySettings};
pub use mechanics::{Load, Mechanics, MechanicsSettings};
pub use model::{ElectricalRate, ElectricalState, MachineModel, Rate};
pub use sensors::{CalibrationLine, Channel, CurrentFault, MeasurementSettings, Sensors};
pub use warming::WarmingSettings;

settings! {
    /// Settings of the plant.
    PlantSettings "" {
        /// Parameters of the machine.
        machine: MachineSettings = MachineSettings::DEFAULT;
        /// Saliency of the machine in model A; no effect with `iron`.
        saliency: SaliencySettings = SaliencySettings::DEFAULT;
        /// Magnetic settings of the energy model; if none are given, the machine is model A.
        iron: Option<IronSettings> = None;
        /// The shaft and its load.
        mechanics: MechanicsSettings = MechanicsSettings::DEFAULT;
        /// Warming of the resistances.
        warming: WarmingSettings = WarmingSettings::DEFAULT;
        /// The dc link.
        dc_link: DcLinkSettings = DcLinkSettings::DEFAULT;
        /// The inverter.
        inverter: InverterSettings = InverterSettings::DEFAULT;
        /// The current sensors and the ADC.
        measurement: MeasurementSettings = MeasurementSettings::DEFAULT;
        /// The encoder.
        encoder: EncoderSettings = EncoderSettings::DEFAULT;
        /// Integration steps per PWM period. The default of two steps differs from 24 steps by less than 1e-5 A. The
        /// analog filter assumes a straight current between the steps.
        substeps: u32 = 2, 1.0..=1000.0, "";
    }
}

/// The plant.
#[derive(Clone, Debug)]
pub struct Plant {
    motor: Motor,
    around: Around,
    dc_link: DcLink,
    /// Warming; none if the resistances are constant.
    warming: Option<Warming>,
    periods: u64,
    /// Whether anything changes once a period.
    moves: bool,
    encoder: Encoder,
    rng: Xoshiro256PlusPlus,
    applied: Complex,
    hardware: Hardware,
    /// Compare values on their way: computed in the last period, in force in the present one.
    pending: Compare,
}

impl Plant {
    /// Makes the plant at rest, without currents and flux. Equal settings and seeds give exactly equal plants.
    ///
    /// # Errors
    /// [`PlantError`] with the setting that is refused.
    pub fn new(settings: &PlantSettings, seed: u64) -> Result<Self, PlantError> {
        settings.check()?;
        let mechanics = Mechanics::new(&settings.mechanics)?;
        let motor = match &settings.iron {
            None => {
                let machine = Machine::new(&settings.machine, &settings.saliency)?;
                Motor::A(MotorModel::new(machine, mechanics))
            }
            Some(iron) => {
                let machine = EnergyMachine::new(&settings.machine, iron)?;
                Motor::Energy(Box::new(MotorModel::new(machine, mechanics)))
            }
        };
        Ok(Self {
            motor,
            around: Around {
                inverter: Inverter::new(&settings.inverter)?,
                sensors: Sensors::new(&settings.measurement)?,
                substeps: settings.substeps,
                open: None,
                dead: None,
                taken: 0.0,
                volt_seconds: Complex::ZERO,
            },
            dc_link: DcLink::new(&settings.dc_link, settings.inverter.vdc)?,
            warming: Warming::new(&settings.warming, &settings.machine)?,
            periods: 0,
            moves: settings.dc_link.moves()
                || settings.warming.acts()
                || settings.measurement.dc_lag_us > 0.0,
            encoder: Encoder::new(&settings.encoder)?,
            rng: Xoshiro256PlusPlus::seed_from_u64(seed),
            applied: Complex::ZERO,
            hardware: Hardware::empty(),
            pending: Compare::OFF,
        })
    }

    /// Returns the present readings of ADCs, counter and hardware. Each call draws new noise and clears the reported
    /// hardware events.
    #[inline(never)]
    pub fn sample(&mut self) -> Sample {
        let [current_a, current_b] = self.around.sensors.currents(&mut self.rng);
        Sample {
            current_a,
            current_b,
            // There are only two sensors.
            current_c: 0,
            dc_link: self.around.sensors.dc_link(self.around.inverter.vdc, &mut self.rng),
            heat_sink: self.around.sensors.heat_sink(),
            encoder: self.encoder.count(),
            hardware: std::mem::take(&mut self.hardware),
        }
    }

    /// Advances by one control period with the outputs that a drive computed from the sample at its beginning: the
    /// compare values take effect a period later, except that outputs switch off at once.
    pub fn period(&mut self, compare: &Compare, output: &Output) {
        if !compare.enabled {
            self.pending = Compare::OFF;
        }
        self.set_chopper(output.chopper.into());
        self.set_relay(output.relay);
        let acting = std::mem::replace(&mut self.pending, *compare);
        self.advance(&acting, PERIOD_S.into());
    }

    /// Advances by one PWM period of `period_s` seconds with these compare values, which the caller has delayed.
    #[inline(never)] // its models are compiled once, not in every crate that runs a plant
    pub fn advance(&mut self, compare: &Compare, period_s: f64) {
        let around = &mut self.around;
        whichever!(&mut self.motor, motor => around.advance(motor, compare, period_s));
        self.applied = around.volt_seconds / period_s;
        self.encoder.follow(self.mechanical_angle());
        if self.moves {
            self.slow(period_s);
        }
    }

    /// Integrates only the motor over `h` seconds at the constant terminal voltage `v`, V, without inverter, sensors and encoder.
    pub fn step_motor(&mut self, v: Complex, h: f64) {
        whichever!(&mut self.motor, motor => motor.step(v, h));
    }

    /// Advances the quantities that change once a period: the dc link and its sensor, and the resistances.
    fn slow(&mut self, period_s: f64) {
        let around = &mut self.around;
        if self.dc_link.settings.moves() {
            let i = whichever!(&self.motor, motor => motor.state.electrical.current());
            let taken = around.taken + around.inverter.conduction_loss(i) * period_s;
            around.inverter.vdc = self.dc_link.after(around.inverter.vdc, taken, period_s);
        }
        around.sensors.follow_dc_link(around.inverter.vdc, period_s);
        self.periods += 1;
        if let Some((rs, rr)) = self.warming.and_then(|w| w.resistances(self.periods, period_s)) {
            // The values are in range: half to three times those that `new` has accepted.
            let _ = self.set_resistances(rs, rr);
        }
    }

    /// Returns the motor with its shaft and state, if it is the energy model.
    pub fn energy_model(&self) -> Option<&MotorModel<EnergyMachine>> {
        match &self.motor {
            Motor::A(_) => None,
            Motor::Energy(motor) => Some(motor),
        }
    }

    /// Pole pairs.
    pub fn pole_pairs(&self) -> f64 {
        whichever!(&self.motor, motor => motor.machine.pole_pairs())
    }

    /// Rotor time constant, s, at the nominal flux.
    pub fn tau_r(&self) -> f64 {
        whichever!(&self.motor, motor => motor.machine.tau_r())
    }

    /// Torque per rotor flux and current across it, 3/2 P Lm/Lr, N m/(Wb A), at the nominal flux.
    pub fn torque_factor(&self) -> f64 {
        whichever!(&self.motor, motor => motor.machine.torque_factor())
    }

    /// Stator current, A, in the stator frame.
    pub fn current(&self) -> Complex {
        whichever!(&self.motor, motor => motor.state.electrical.current())
    }

    /// Phase currents, A.
    pub fn phase_currents(&self) -> [f64; 3] {
        phases(self.current())
    }

    /// Rotor flux linkage, Wb, in the stator frame.
    pub fn rotor_flux(&self) -> Complex {
        whichever!(&self.motor, motor => motor.state.electrical.rotor_flux())
    }

    /// True angle of the rotor flux, electrical rad, -pi to pi; 0 without flux.
    pub fn rotor_flux_angle(&self) -> f64 {
        self.rotor_flux().arg()
    }

    /// Electromagnetic torque, N m.
    pub fn torque(&self) -> f64 {
        whichever!(&self.motor, motor => motor.machine.torque(&motor.state.electrical))
    }

    /// Mechanical angle of the rotor, rad, not wrapped, 0 at the start.
    pub fn mechanical_angle(&self) -> f64 {
        whichever!(&self.motor, motor => motor.state.angle)
    }

    /// Mechanical speed of the rotor, rad/s.
    pub fn mechanical_speed(&self) -> f64 {
        whichever!(&self.motor, motor => motor.state.speed)
    }

    /// Line-to-neutral voltage at the terminals, V, averaged over the last period.
    pub fn applied_voltage(&self) -> Complex {
        self.applied
    }

    /// Dc-link voltage, V.
    pub fn dc_link(&self) -> f64 {
        self.around.inverter.vdc
    }

    /// Current that inverter and motor have taken from the dc link in the last period of `period_s` seconds, mean, A.
    pub fn dc_current(&self, period_s: f64) -> f64 {
        let lost = self.around.inverter.conduction_loss(self.current());
        (self.around.taken / period_s + lost) / self.dc_link()
    }

    /// Changes the dc-link voltage, V. Behind a rectifier it changes both the present voltage and the peak of the rectified mains.
    ///
    /// # Errors
    /// [`PlantError`] outside 0 to 1000 V.
    pub fn set_dc_link(&mut self, vdc: f64) -> Result<(), PlantError> {
        self.around.inverter.set_dc_link(vdc)?;
        self.dc_link.nominal = vdc;
        Ok(())
    }

    /// Returns the rate of the stator current, A/s, at the terminal voltage `v`, V, in the stator frame.
    pub fn current_rate(&self, v: Complex) -> Complex {
        whichever!(&self.motor, motor => {
            let speed = motor.machine.pole_pairs() * motor.state.speed;
            motor.machine.derivative(&motor.state.electrical, v, speed).current_rate()
        })
    }

    /// Returns the rates of the phase currents while the terminals are shorted, A/s.
    pub fn shorted_slopes(&self) -> [f64; 3] {
        phases(self.current_rate(Complex::ZERO))
    }

    /// Changes the number of pulses of each leg in a period.
    pub fn set_pulses(&mut self, pulses: u16) {
        self.around.inverter.set_pulses(pulses);
    }

    /// Changes the dead time, us.
    ///
    /// # Errors
    /// [`PlantError`] outside 0 to 10 us.
    pub fn set_dead_time(&mut self, us: f64) -> Result<(), PlantError> {
        self.around.inverter.set_dead_time(us)
    }

    /// Couples another load. A held speed applies at once; a free shaft continues at its present speed.
    ///
    /// # Errors
    /// [`PlantError`] for its torque or speed.
    pub fn set_load(&mut self, load: Load) -> Result<(), PlantError> {
        whichever!(&mut self.motor, motor => {
            motor.mechanics.set_load(load)?;
            motor.hold_speed();
        });
        Ok(())
    }

    /// Changes the resistances of stator and rotor, ohm (a warmer motor), and keeps everything else.
    ///
    /// # Errors
    /// [`PlantError`].
    pub fn set_resistances(&mut self, rs: f64, rr: f64) -> Result<(), PlantError> {
        MachineSettings { rs, rr, ..MachineSettings::DEFAULT }.check()?;
        whichever!(&mut self.motor, motor => motor.machine.set_resistances(rs, rr));
        Ok(())
    }

    /// Changes sensors and magnetic settings to those of `settings`, and keeps the state: an asymmetry that arises during a run. Model A
    /// has no magnetic settings.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn set_asymmetry(&mut self, settings: &PlantSettings) -> Result<(), PlantError> {
        self.around.sensors.set(&settings.measurement)?;
        if let (Motor::Energy(motor), Some(iron)) = (&mut self.motor, &settings.iron) {
            motor.machine = EnergyMachine::new(&settings.machine, iron)?;
        }
        Ok(())
    }

    /// Changes the assumed saliency of model A and keeps the state. It has no effect on the energy model, whose
    /// saliency comes from its magnetic settings.
    ///
    /// # Errors
    /// As [`Machine::new`].
    pub fn set_saliency(
        &mut self,
        machine: &MachineSettings,
        saliency: &SaliencySettings,
    ) -> Result<(), PlantError> {
        if let Motor::A(motor) = &mut self.motor {
            motor.machine = Machine::new(machine, saliency)?;
        }
        Ok(())
    }

    /// Rotates the rotor flux by an angle, electrical rad, at once. An estimate of the flux angle is then wrong by that
    /// angle.
    pub fn turn_rotor_flux(&mut self, angle: f64) {
        let turn = Complex::new(angle.cos(), angle.sin());
        whichever!(&mut self.motor, motor => {
            motor.state.electrical = motor.machine.with_turned_flux(&motor.state.electrical, turn);
        });
    }

    /// Sets the fault of a current channel.
    pub fn set_current_fault(&mut self, channel: Channel, fault: CurrentFault) {
        self.around.sensors.set_fault(channel, fault);
    }

    /// Interrupts a phase between inverter and motor, 0 to 2, at once, or connects all.
    ///
    /// # Errors
    /// [`PlantError`] for another number.
    pub fn set_open_phase(&mut self, phase: Option<usize>) -> Result<(), PlantError> {
        if let Some(phase) = phase {
            error::check("open phase", phase as f64, 0.0..=2.0, "")?;
        }
        self.around.open = phase;
        Ok(())
    }

    /// Keeps the high side, the low side or both of a leg, 0 to 2, off whatever is commanded, or lets all gates work. It
    /// acts on the averaged inverter.
    pub fn set_dead_gates(&mut self, dead: Option<(usize, [bool; 2])>) {
        self.around.dead = dead.map(|(leg, off)| (leg.min(2), off));
    }

    /// Sets the fault of the encoder.
    pub fn set_encoder_fault(&mut self, fault: EncoderFault) {
        self.encoder.fault = fault;
    }

    /// Changes the ADC counts of the heat-sink temperature.
    pub fn set_heat_sink(&mut self, code: u16) {
        self.around.sensors.set_heat_sink(code);
    }

    /// Adds events to those that the next sample reports.
    pub fn report(&mut self, events: Hardware) {
        self.hardware = self.hardware.union(events);
    }
}

/// The example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
