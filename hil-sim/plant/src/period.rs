//! One PWM period of a motor behind its inverter, seen by the sensors.

use drive_core::Compare;

use crate::complex::Complex;
use crate::integrate::MotorModel;
use crate::inverter::Inverter;
use crate::model::{ElectricalState as _, MachineModel};
use crate::open_phase::OpenPhase;
use crate::sensors::Sensors;
use crate::{freewheel, switched};

/// Integration steps per period while the outputs are off: at most this fraction of the period.
const FREEWHEEL_SUBSTEPS: u32 = 8;

/// What stands around the motor, whichever model it is.
#[derive(Clone, Debug)]
pub(crate) struct Around {
    pub inverter: Inverter,
    pub sensors: Sensors,
    pub substeps: u32,
    pub open: Option<OpenPhase>,
}

impl Around {
    /// Integrates over one period; returns the terminal voltage integrated over it, V s.
    #[inline]
    pub(crate) fn advance<M: MachineModel>(
        &mut self,
        motor: &mut MotorModel<M>,
        compare: &Compare,
        period: f64,
    ) -> Complex {
        let volt_seconds = if !compare.enabled {
            self.freewheel(motor, period)
        } else if self.inverter.switched {
            self.switched(motor, compare, period)
        } else {
            self.averaged(motor, compare, period)
        };
        self.inverter.previous = *compare;
        volt_seconds
    }

    #[inline]
    fn averaged<M: MachineModel>(
        &mut self,
        motor: &mut MotorModel<M>,
        compare: &Compare,
        period: f64,
    ) -> Complex {
        let averaged = self.inverter.averaged(compare, period);
        let h = period / f64::from(self.substeps);
        let mut volt_seconds = Complex::ZERO;
        for n in 1..=self.substeps {
            let before = motor.state.electrical.current();
            motor.begin_step();
            volt_seconds += averaged.step(motor, self.open, h);
            motor.end_step(h);
            self.sensors.follow(before, motor.state.electrical.current(), h);
            if 2 * n == self.substeps {
                self.sensors.hold_middle();
            }
        }
        volt_seconds
    }

    fn switched<M: MachineModel>(
        &mut self,
        motor: &mut MotorModel<M>,
        compare: &Compare,
        period: f64,
    ) -> Complex {
        let pattern = switched::Pattern::new(&self.inverter, compare, period);
        let longest = period / f64::from(self.substeps);
        let mut volt_seconds = Complex::ZERO;
        for (duration, levels) in pattern.pieces() {
            let steps = (duration / longest).ceil().max(1.0);
            let h = duration / steps;
            for _ in 0..steps as u32 {
                motor.begin_step();
                let (machine, inverter, open) = (&motor.machine, &self.inverter, self.open);
                let i = motor.state.electrical.current();
                let legs = switched::leg_voltages(levels, i, inverter.vdc);
                let (state, v) = motor.stepped(h, |x, w| {
                    let v = inverter.dropped(legs, x.current());
                    match open {
                        None => (machine.derivative(x, v, w), v),
                        Some(open) => open.rates(machine, x, v, w),
                    }
                });
                volt_seconds += v * h;
                motor.state = state;
                if let Some(open) = open {
                    open.confine(motor);
                }
                motor.end_step(h);
                self.sensors.follow(i, motor.state.electrical.current(), h);
            }
        }
        volt_seconds
    }

    fn freewheel<M: MachineModel>(&mut self, motor: &mut MotorModel<M>, period: f64) -> Complex {
        let substeps = self.substeps.max(FREEWHEEL_SUBSTEPS);
        let h = period / f64::from(substeps);
        let mut volt_seconds = Complex::ZERO;
        for _ in 0..substeps {
            let before = motor.state.electrical.current();
            motor.begin_step();
            volt_seconds += freewheel::step(motor, self.inverter.vdc, self.open, h);
            motor.end_step(h);
            self.sensors.follow(before, motor.state.electrical.current(), h);
        }
        volt_seconds
    }
}
