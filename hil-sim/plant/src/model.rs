//! The interface of a machine model to shaft, inverter and sensors.

use crate::complex::Complex;

/// A machine in the stator frame, with amplitude-invariant space vectors; `w` is the electrical speed of the rotor in
/// rad/s. A model is a set of coefficients; its state is separate.
pub trait MachineModel: Copy {
    /// The integrated state.
    type State: ElectricalState;

    /// Pole pairs.
    fn pole_pairs(&self) -> f64;

    /// Electromagnetic torque, N m.
    fn torque(&self, x: &Self::State) -> f64;

    /// Time derivative of the state at the terminal voltage `v`, V.
    fn derivative(&self, x: &Self::State, v: Complex, w: f64) -> Rate<Self>;

    /// As [`Self::derivative`], while the current is confined to the line through zero along the unit vector `axis`,
    /// and the terminal voltage has the component `v_axis` along it. Also returns the terminal voltage, whose other
    /// component follows from the machine.
    fn derivative_on_line(
        &self,
        x: &Self::State,
        v_axis: f64,
        axis: Complex,
        w: f64,
    ) -> (Rate<Self>, Complex);

    /// As [`Self::derivative`] with open terminals, which make the current zero. Also returns the terminal voltage.
    fn derivative_open(&self, x: &Self::State, w: f64) -> (Rate<Self>, Complex);

    /// Returns the state with the stator current `i`, A, and unchanged rotor flux.
    fn with_current(&self, x: &Self::State, i: Complex) -> Self::State;

    /// Returns the state with its rotor flux rotated by `turn`, a unit vector.
    fn with_turned_flux(&self, x: &Self::State, turn: Complex) -> Self::State;

    /// Updates quantities that change slowly with the state, after a step of `h` seconds.
    #[inline]
    fn after_step(&mut self, _: &Self::State, _h: f64) {}

    /// Makes the dependent quantities of a state consistent with the integrated ones.
    fn settle(&self, x: &mut Self::State) {
        self.turn(x);
        self.finish(x);
    }

    /// Sets the quantities that rotate with the rotor to its angle. Once a period is enough, because they are integrated in between.
    #[inline]
    fn turn(&self, _: &mut Self::State) {}

    /// Stores the derivatives at a stage of an integration step.
    #[inline]
    fn correct(&self, _: &mut Self::State) {}

    /// Removes the error of an integration step from quantities that depend on the integrated ones.
    #[inline]
    fn finish(&self, _: &mut Self::State) {}
}

/// Time derivative of the state of a model.
pub type Rate<M> = <<M as MachineModel>::State as ElectricalState>::Rate;

/// The state of a machine, as the integration needs it.
pub trait ElectricalState: Copy + Default {
    /// Its time derivative.
    type Rate: Copy + ElectricalRate;

    /// Stator current, A.
    fn current(&self) -> Complex;

    /// Rotor flux linkage, Wb.
    fn rotor_flux(&self) -> Complex;

    /// Becomes `from + rate h`. (It works in place, because a state may be large.)
    fn set_moved(&mut self, from: &Self, rate: &Self::Rate, h: f64);

    /// Becomes `from + (k0 + 2 k1 + 2 k2 + k3) h/6`.
    fn set_advanced(&mut self, from: &Self, k: [&Self::Rate; 4], h: f64);
}

/// The time derivative of a state.
pub trait ElectricalRate {
    /// Rate of the stator current, A/s.
    fn current_rate(&self) -> Complex;
}

/// Defines how a state follows its rates: its places, each with the field of the rate.
macro_rules! integrated {
    ($rate:ty: $($($place:ident).+ = $of:ident),+) => {
        #[inline(always)]
        fn set_moved(&mut self, x: &Self, k: &$rate, h: f64) {
            $(self.$($place).+ = x.$($place).+ + k.$of * h;)+
        }

        #[inline(always)]
        fn set_advanced(&mut self, x: &Self, k: [&$rate; 4], h: f64) {
            let sixth = h * (1.0 / 6.0);
            $(
                let sum = k[0].$of + k[3].$of + (k[1].$of + k[2].$of) * 2.0;
                self.$($place).+ = x.$($place).+ + sum * sixth;
            )+
        }
    };
}
pub(crate) use integrated;
