//! One PWM period of a motor behind its inverter, seen by the sensors.

use drive_core::Compare;

use crate::averaged::RealSwitches;
use crate::complex::{Complex, phases};
use crate::integrate::MotorModel;
use crate::inverter::Inverter;
use crate::model::{ElectricalState as _, MachineModel};
use crate::sensors::Sensors;
use crate::switched::Legs;
use crate::terminals::{All, Terminals, Without};
use crate::{averaged, freewheel, switched};

/// Smallest number of integration steps per period while the outputs are off.
const FREEWHEEL_SUBSTEPS: u32 = 8;

/// Everything around the motor, independent of its model.
#[derive(Clone, Debug)]
pub(crate) struct Around {
    pub inverter: Inverter,
    pub sensors: Sensors,
    pub substeps: u32,
    /// The interrupted phase, 0 to 2.
    pub open: Option<usize>,
    /// A leg, 0 to 2, and whether its high and low side stay off whatever is commanded.
    pub dead: Option<(usize, [bool; 2])>,
    /// Energy that inverter and motor have taken from the dc link in the last period, J.
    pub taken: f64,
    /// Terminal voltage integrated over the last period, V s.
    pub volt_seconds: Complex,
}

impl Around {
    /// Integrates over one period.
    #[inline]
    pub(crate) fn advance<M: MachineModel>(
        &mut self,
        motor: &mut MotorModel<M>,
        compare: &Compare,
        period: f64,
    ) {
        motor.begin_period();
        self.sensors.begin_period(period, self.inverter.settings.pulses);
        (self.taken, self.volt_seconds) = (0.0, Complex::ZERO);
        if !compare.enabled {
            self.freewheel(motor, period);
        } else if let Some((leg, off)) = self.dead {
            self.with_dead_gates(motor, compare, period, leg, off);
        } else if self.inverter.settings.switched {
            match self.open {
                None => self.switched(All, motor, compare, period),
                Some(open) => self.switched(|legs| Without(open, legs), motor, compare, period),
            }
        } else {
            // With an interrupted phase the code does not distinguish ideal from real switches.
            let source = self.inverter.averaged(compare, period);
            match self.open {
                None if source.ideal() => self.averaged(&All(source), motor, period),
                None => self.averaged(&All(RealSwitches(source)), motor, period),
                Some(open) => self.averaged(&Without(open, RealSwitches(source)), motor, period),
            }
        }
        self.inverter.previous = *compare;
    }

    /// Does integration steps of `h` seconds, each by `step`, with the shaft and the sensors.
    #[inline]
    fn steps<M: MachineModel>(
        &mut self,
        motor: &mut MotorModel<M>,
        times: u32,
        h: f64,
        step: impl Fn(&mut MotorModel<M>, &Inverter) -> Complex,
    ) {
        for _ in 0..times {
            let before = motor.state.electrical.current();
            motor.begin_step();
            let volt_seconds = step(motor, &self.inverter);
            motor.end_step(h);
            let after = motor.state.electrical.current();
            self.sensors.follow(before, after, h);
            self.taken += 1.5 * (((before + after) * 0.5).conj() * volt_seconds).re;
            self.volt_seconds += volt_seconds;
        }
    }

    /// Uses the averages of the period as the source.
    #[inline]
    fn averaged<M: MachineModel>(
        &mut self,
        terminals: &impl Terminals,
        motor: &mut MotorModel<M>,
        period: f64,
    ) {
        let h = period / f64::from(self.substeps);
        self.steps(motor, self.substeps, h, |motor, inverter| {
            averaged::step(terminals, motor, h, inverter.sign.kink)
        });
    }

    /// Uses the averages of the period with a leg whose high or low side, or both, stay off. The diode of the other side
    /// then carries the current that the dead side would carry. If neither direction of the current is consistent with
    /// the leg's voltage, the phase carries no current.
    #[cold]
    fn with_dead_gates<M: MachineModel>(
        &mut self,
        motor: &mut MotorModel<M>,
        compare: &Compare,
        period: f64,
        leg: usize,
        off: [bool; 2],
    ) {
        let inverter = &self.inverter;
        let source = |dead: bool, rail: f64| {
            let mut acting = *compare;
            if dead {
                *[&mut acting.a, &mut acting.b, &mut acting.c][leg] = (rail * inverter.top) as u16;
            }
            RealSwitches(inverter.averaged(&acting, period))
        };
        // A current into the machine comes from the high side, a current back goes to the low side.
        let ways = [(1.0, source(off[0], 0.0)), (-1.0, source(off[1], 1.0))];
        let substeps = self.substeps.max(FREEWHEEL_SUBSTEPS);
        let h = period / f64::from(substeps);
        self.steps(motor, substeps, h, |motor, inverter| {
            let before = motor.state;
            for (sign, way) in ways {
                let volt_seconds = averaged::step(&All(way), motor, h, inverter.sign.kink);
                if sign * phases(motor.state.electrical.current())[leg] >= 0.0 {
                    return volt_seconds;
                }
                motor.state = before;
            }
            averaged::step(&Without(leg, ways[0].1), motor, h, inverter.sign.kink)
        });
    }

    /// Uses the legs between their edges as the source.
    fn switched<M: MachineModel, T: Terminals>(
        &mut self,
        terminals: impl Fn(Legs) -> T,
        motor: &mut MotorModel<M>,
        compare: &Compare,
        period: f64,
    ) {
        let longest = period / f64::from(self.substeps);
        for _ in 0..self.inverter.settings.pulses {
            let pulse_s = period / f64::from(self.inverter.settings.pulses);
            let pattern = switched::Pattern::new(&self.inverter, compare, pulse_s);
            for (duration, levels) in pattern.pieces() {
                let steps = (duration / longest).ceil().max(1.0);
                let h = duration / steps;
                self.steps(motor, steps as u32, h, |motor, inverter| {
                    let legs = Legs::new(inverter, levels, motor.state.electrical.current());
                    motor.advance(&terminals(legs), h) * h
                });
            }
            self.inverter.previous = *compare;
        }
    }

    fn freewheel<M: MachineModel>(&mut self, motor: &mut MotorModel<M>, period: f64) {
        let open = self.open;
        let substeps = self.substeps.max(FREEWHEEL_SUBSTEPS);
        let h = period / f64::from(substeps);
        let step =
            |motor: &mut _, inverter: &Inverter| freewheel::step(motor, inverter.vdc, open, h);
        self.steps(motor, substeps, h, step);
    }
}
