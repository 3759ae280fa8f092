//! Machines for the commissioning: true parameters, and random machines.

use drive_settings::tuning::bisected;

use crate::prelude::*;

/// Parameters of the inverse-Gamma circuit.
#[derive(Clone, Copy, Debug)]
pub struct Circuit {
    /// Stator resistance, ohm.
    pub r_s: f64,
    /// Transient inductance, H.
    pub leakage: f64,
    /// Rotor resistance as seen by the stator, ohm.
    pub r_r: f64,
    /// Coupled magnetising inductance, H.
    pub coupled: f64,
}

impl Circuit {
    /// Converts a T circuit.
    pub fn of([r_s, r_r, l_ls, l_lr, l_m]: [f64; 5]) -> Self {
        let k = l_m / (l_m + l_lr);
        Self { r_s, leakage: l_ls + k * l_lr, r_r: k * k * r_r, coupled: k * l_m }
    }

    /// Returns the circuit of the simulated motor, including the switch in the path of a phase current and the mean of
    /// the phases; with saturation, at its nominal flux.
    pub fn of_plant(config: &Config) -> Self {
        let (m, i) = (plant_settings(config).machine, &config.inverter);
        let more = i.on_resistance + (i.more_ohm_b + i.more_ohm_c) / 3.0;
        Self::of([m.rs + more, m.rr, m.lls, m.llr, m.lm])
    }

    /// Circuit of the simulated motor at a magnetising current, A: its magnetising inductance is the chord of the curve there.
    pub fn at(config: &Config, i_d: f64) -> Self {
        let mut config = config.clone();
        if let Some(iron) = plant_settings(&config).iron {
            let bent = |flux: f64| {
                (iron.saturation - 1.0) * (flux / iron.psi_n).powi(iron.exponent as i32)
            };
            let straight = iron.saturation * config.motor.l_m * i_d;
            let is_below = |flux: f64| flux * (1.0 + bent(flux)) < straight;
            config.motor.l_m = bisected((0.0, straight), 50, &is_below).0 / i_d;
        }
        Self::of_plant(&config)
    }

    /// Rotor time constant, s.
    pub fn tau_r(&self) -> f64 {
        self.coupled / self.r_r
    }

    /// Returns the errors of the values of this circuit, % of the true ones.
    pub fn errors_pct(&self, truth: &Self) -> [f64; 5] {
        let (found, truth) = (self.values(), truth.values());
        std::array::from_fn(|n| 100.0 * (found[n].1 / truth[n].1 - 1.0))
    }

    /// Returns the name for the metrics, and the value, of each parameter.
    pub fn values(&self) -> [(&'static str, f64); 5] {
        [
            ("r_s", self.r_s),
            ("sigma_ls", self.leakage),
            ("rr", self.r_r),
            ("lm", self.coupled),
            ("tau_r", self.tau_r()),
        ]
    }
}

/// Returns a random factor up to `most`, or down to its reciprocal.
fn factor(random: &mut impl Rng, most: f64) -> f64 {
    random.random_range(-most.ln()..=most.ln()).exp()
}

/// Multiplies resistances, inductances and saliencies of a machine by random factors, one for each, up to `spread`.
pub fn around(config: &Config, random: &mut impl Rng, spread: f64) -> Config {
    let mut factor = || factor(random, spread);
    let mut drawn = config.clone();
    let saliency = plant_settings(config).saliency;
    let (m, leakage) = (&mut drawn.motor, factor());
    m.r_s *= factor();
    m.r_r *= factor();
    m.l_m *= factor();
    m.l_ls *= leakage;
    m.l_lr *= leakage;
    let (a_psi, b1) = (factor(), factor());
    if config.model.plant == PlantModel::A {
        drawn.saliency.a_psi = saliency.a_psi * a_psi;
        drawn.saliency.b1 = Some(saliency.b1 * b1);
    }
    drawn
}

/// Returns a random machine and board around those of the configuration. Each parameter and saliency is multiplied or
/// divided by a factor up to `spread.machine` (2 unless set). The shaft is free, the dead time is 2 to 5 us, the
/// further inverter voltage error 0.5 to 3 V at 311 V, gain errors are up to 0.5 % and offsets up to 0.7 % of the
/// range. The drive knows its dead time.
pub fn drawn(config: &Config, seed: u64) -> Config {
    let mut random = seeded(seed);
    let spread = if config.spread.machine > 1.0 { config.spread.machine } else { 2.0 };
    let mut drawn = around(config, &mut random, spread);
    drawn.motor.inertia *= (factor(&mut random, 5.0) * 0.632_456).clamp(0.2, 2.0);
    drawn.motor.friction = 1e-4;
    drawn.load.mode = LoadMode::Free;
    let volts = config.inverter.dc_link_v / 311.0;
    let mut between = |low: f64, high: f64| random.random_range(low..=high);
    drawn.inverter.dead_time_s = between(2e-6, 5e-6);
    drawn.drive.inverter.dead_time_s = drawn.inverter.dead_time_s as f32;
    drawn.inverter.residual_v = Some(between(0.5, 3.0) * volts);
    let offset = 0.03 / 4.47 * config.measurement.range_a;
    let errors = &mut drawn.measurement;
    (errors.gain_error_a, errors.gain_error_b) = (between(-0.005, 0.005), between(-0.005, 0.005));
    (errors.offset_a, errors.offset_b) = (between(-offset, offset), between(-offset, offset));
    if config.commission.disturbed {
        let r_s = drawn.motor.r_s;
        let [a, b, c] = [(); 3].map(|()| r_s * between(-0.02, 0.02));
        let [late_a, late_b, late_c] = [(); 3].map(|()| between(-0.1, 0.1));
        let (axis, inverter) = (between(-180.0, 180.0), &mut drawn.inverter);
        drawn.motor.r_s += a;
        (inverter.more_ohm_b, inverter.more_ohm_c) = (b - a, c - a);
        inverter.extra_dead_time_s += late_a * 1e-6;
        inverter.more_dead_time_b_us = late_b - late_a;
        inverter.more_dead_time_c_us = late_c - late_a;
        if config.model.plant == PlantModel::A {
            (drawn.saliency.stator_fixed, drawn.saliency.stator_fixed_deg) = (0.01, axis);
        }
        drawn.measurement.lag_b_us = 10.0;
    }
    drawn
}
