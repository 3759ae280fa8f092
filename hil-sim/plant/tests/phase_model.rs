//! Checks of the machine model against the six phase equations of Eq. 2.8, which are derived and integrated
//! independently. The states are the flux linkages of three stator and three rotor windings; the inductances between
//! them are functions of the rotor angle; the integration is the midpoint rule with small steps.

use std::f64::consts::TAU;

use motor_plant::{
    Complex, Load, Machine, MachineModel, MachineSettings, Mechanics, MechanicsSettings,
    MotorModel, SaliencySettings, clarke, phases,
};
use nalgebra::{Matrix6, Vector6};

const PERIOD: f64 = 1.0 / 6000.0;
/// Steps of the phase model per period.
const FINE: u32 = 42;
const LOAD: f64 = 0.3;

/// Six coupled windings on a free shaft.
struct PhaseModel {
    settings: MachineSettings,
    inertia: f64,
    friction: f64,
    linkages: Vector6<f64>,
    speed: f64,
    /// Electrical angle.
    angle: f64,
}

impl PhaseModel {
    /// Inductances of the windings at an electrical angle, or their derivatives by that angle.
    fn inductances(&self, angle: f64, derivative: bool) -> Matrix6<f64> {
        // Sinusoidal windings: the mutual inductance of two is proportional to the cosine of the angle between their
        // axes, with M = 2/3 Lm at angle zero (the source: Lm = 3/2 M).
        let m = 2.0 / 3.0 * self.settings.lm;
        Matrix6::from_fn(|row, column| {
            let axis = |k: usize, angle: f64| TAU / 3.0 * (k % 3) as f64 + angle;
            let turns = |k: usize| if k < 3 { 0.0 } else { angle };
            let between = axis(row, turns(row)) - axis(column, turns(column));
            let same_side = (row < 3) == (column < 3);
            if derivative {
                let sign = if row < 3 { 1.0 } else { -1.0 };
                return if same_side { 0.0 } else { sign * m * between.sin() };
            }
            let leakage = match (row == column, row < 3) {
                (false, _) => 0.0,
                (true, true) => self.settings.lls,
                (true, false) => self.settings.llr,
            };
            leakage + m * between.cos()
        })
    }

    fn currents(&self, linkages: &Vector6<f64>, angle: f64) -> Vector6<f64> {
        self.inductances(angle, false).lu().solve(linkages).expect("regular")
    }

    fn torque(&self, currents: &Vector6<f64>, angle: f64) -> f64 {
        let by_electrical_angle =
            0.5 * (currents.transpose() * self.inductances(angle, true) * currents)[0];
        by_electrical_angle * f64::from(self.settings.pole_pairs)
    }

    fn rates(
        &self,
        linkages: &Vector6<f64>,
        speed: f64,
        angle: f64,
        v: [f64; 3],
    ) -> (Vector6<f64>, f64) {
        let i = self.currents(linkages, angle);
        let rate = Vector6::from_fn(|k, _| {
            if k < 3 { v[k] - self.settings.rs * i[k] } else { -self.settings.rr * i[k] }
        });
        let torque = self.torque(&i, angle);
        (rate, (torque - LOAD - self.friction * speed) / self.inertia)
    }

    fn step(&mut self, v: [f64; 3], h: f64) {
        let pairs = f64::from(self.settings.pole_pairs);
        let (rate, acceleration) = self.rates(&self.linkages, self.speed, self.angle, v);
        let middle_speed = self.speed + 0.5 * h * acceleration;
        let middle_angle = self.angle + 0.5 * h * pairs * self.speed;
        let middle = self.linkages + rate * (0.5 * h);
        let (rate, acceleration) = self.rates(&middle, middle_speed, middle_angle, v);
        self.linkages += rate * h;
        self.speed += acceleration * h;
        self.angle += pairs * middle_speed * h;
    }
}

#[test]
fn agrees_with_the_six_phase_equations() {
    // The leakages of stator and rotor differ, so that the test would show a mix-up.
    let settings = MachineSettings { lls: 0.0207, llr: 0.0345, ..Default::default() };
    let shaft = MechanicsSettings { load: Load::Free { torque: LOAD }, ..Default::default() };
    let mut motor = MotorModel::new(
        Machine::new(&settings, &SaliencySettings::NONE).expect("machine"),
        Mechanics::new(&shaft).expect("shaft"),
    );
    let mut reference = PhaseModel {
        settings,
        inertia: shaft.inertia,
        friction: shaft.friction,
        linkages: Vector6::zeros(),
        speed: 0.0,
        angle: 0.0,
    };
    let (mut i_error, mut psi_error, mut speed_error, mut torque_error) = (0f64, 0f64, 0f64, 0f64);
    let mut largest = 0f64;
    // 0.3 s: a direct start at 20 Hz, with an injected voltage at 600 Hz.
    for k in 0..1800 {
        let t = f64::from(k) * PERIOD;
        let v = Complex::from_polar(90.0, TAU * 20.0 * t)
            + Complex::from_polar(50.0 * (TAU * 600.0 * t).cos(), 1.0);
        for _ in 0..4 {
            motor.step(v, PERIOD / 4.0);
        }
        for _ in 0..FINE {
            reference.step(phases(v), PERIOD / f64::from(FINE));
        }
        let i = reference.currents(&reference.linkages, reference.angle);
        let stator = clarke([i[0], i[1], i[2]]);
        let to_stator_frame = Complex::from_polar(1.0, reference.angle);
        let rotor_linkage =
            clarke([reference.linkages[3], reference.linkages[4], reference.linkages[5]]);
        let x = &motor.state.electrical;
        largest = largest.max(stator.norm());
        i_error = i_error.max((x.i - stator).norm());
        psi_error = psi_error.max((x.psi - rotor_linkage * to_stator_frame).norm());
        speed_error = speed_error.max((motor.state.speed - reference.speed).abs());
        let torque = reference.torque(&i, reference.angle);
        torque_error = torque_error.max((motor.machine.torque(x) - torque).abs());
    }
    assert!(motor.state.speed > 20.0, "it should have started: {}", motor.state.speed);
    // The midpoint rule has a phase error of (w h)^2/24 per radian of an oscillation. With w = 130 rad/s in the
    // rotating windings and h = 4 us that is 1e-8; over 40 rad and at 11 A, 5e-6 A. The 600 Hz of 0.26 A and the
    // transients of 8 ms add an error of the same size.
    assert!(i_error < 5e-6, "current: {i_error:e} A");
    assert!(psi_error < 5e-7, "rotor flux: {psi_error:e} Wb");
    assert!(speed_error < 5e-5, "speed: {speed_error:e} rad/s");
    assert!(torque_error < 1e-5, "torque: {torque_error:e} N m");
}
