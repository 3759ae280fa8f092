//! The machine and its shaft, integrated by the classical Runge-Kutta method.

use crate::complex::Complex;
use crate::machine::Machine;
use crate::mechanics::Mechanics;
use crate::model::{ElectricalState as _, MachineModel, Rate};
use crate::terminals::{All, Terminals};

/// State of a machine and its shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorState<X> {
    /// Electrical state.
    pub electrical: X,
    /// Mechanical speed, rad/s.
    pub speed: f64,
    /// Mechanical angle of the rotor, rad, not wrapped.
    pub angle: f64,
}

/// A machine on its shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorModel<M: MachineModel = Machine> {
    /// The machine.
    pub machine: M,
    /// The shaft and its load.
    pub mechanics: Mechanics,
    /// The state of both.
    pub state: MotorState<M::State>,
}

impl<M: MachineModel> MotorModel<M> {
    /// Makes a motor without current and flux. It is at rest, or turns already if the load holds a speed.
    pub fn new(machine: M, mechanics: Mechanics) -> Self {
        let mut motor = Self { machine, mechanics, state: MotorState::default() };
        machine.settle(&mut motor.state.electrical);
        motor.hold_speed();
        motor
    }

    /// Sets the speed that the load imposes, if it imposes one. Must be called after a change of load.
    pub fn hold_speed(&mut self) {
        if let Some(speed) = self.mechanics.held_speed() {
            self.state.speed = speed;
        }
    }

    /// Integrates over `h` seconds at the constant terminal voltage `v` (V).
    pub fn step(&mut self, v: Complex, h: f64) {
        self.begin_period();
        self.begin_step();
        self.advance(&All(v), h);
        self.end_step(h);
    }

    /// Sets the values that depend on the rotor angle, for one period.
    #[inline]
    pub(crate) fn begin_period(&mut self) {
        self.mechanics.begin_period(self.state.angle);
        self.machine.turn(&mut self.state.electrical);
    }

    /// Sets the torques on the shaft for an integration step.
    #[inline]
    pub(crate) fn begin_step(&mut self) {
        if self.mechanics.has_extras() {
            let torque = self.machine.torque(&self.state.electrical);
            self.state.speed = self.mechanics.begin(self.state.speed, torque);
        }
    }

    /// Ends an integration step of `h` seconds.
    #[inline]
    pub(crate) fn end_step(&mut self, h: f64) {
        if self.mechanics.has_extras() {
            self.mechanics.end(self.state.speed, h);
        }
        self.machine.after_step(&self.state.electrical, h);
    }

    /// Returns the present derivative of the electrical state, and the terminal voltage.
    #[inline(always)]
    pub(crate) fn rates(&self, terminals: &impl Terminals) -> (Rate<M>, Complex) {
        let w = self.machine.pole_pairs() * self.state.speed;
        terminals.rates(&self.machine, &self.state.electrical, w)
    }

    /// Integrates over `h` seconds; returns the mean terminal voltage.
    #[inline]
    pub(crate) fn advance(&mut self, terminals: &impl Terminals, h: f64) -> Complex {
        self.advance_from(self.rates(terminals), terminals, h)
    }

    /// As [`Self::advance`]; `first` holds the rates at the present state.
    #[inline]
    pub(crate) fn advance_from(
        &mut self,
        first: (Rate<M>, Complex),
        terminals: &impl Terminals,
        h: f64,
    ) -> Complex {
        let (m, p) = (&self.machine, self.machine.pole_pairs());
        let (x0, n0) = (self.state.electrical, self.state.speed);
        let x = &mut self.state.electrical;
        let accelerate = |x: &M::State, n: f64| self.mechanics.acceleration(m.torque(x), n);

        let (k1, v1) = first;
        let a1 = accelerate(x, n0);
        let half = 0.5 * h;
        let n1 = n0 + a1 * half;
        x.set_moved(&x0, &k1, half);
        m.correct(x);
        let (k2, v2) = terminals.rates(m, x, p * n1);
        let a2 = accelerate(x, n1);
        let n2 = n0 + a2 * half;
        x.set_moved(&x0, &k2, half);
        m.correct(x);
        let (k3, v3) = terminals.rates(m, x, p * n2);
        let a3 = accelerate(x, n2);
        let n3 = n0 + a3 * h;
        x.set_moved(&x0, &k3, h);
        m.correct(x);
        let (k4, v4) = terminals.rates(m, x, p * n3);
        let a4 = accelerate(x, n3);

        let sixth = h * (1.0 / 6.0);
        let mean_f = |a: f64, b: f64, c: f64, d: f64| (a + d + (b + c) * 2.0) * sixth;
        x.set_advanced(&x0, [&k1, &k2, &k3, &k4], h);
        m.finish(x);
        terminals.confine(m, x);
        self.state.speed = n0 + mean_f(a1, a2, a3, a4);
        self.state.angle += mean_f(n0, n1, n2, n3);
        (v1 + v4 + (v2 + v3) * 2.0) * (1.0 / 6.0)
    }
}
