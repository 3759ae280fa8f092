//! Response time of the torque to a step, over speed and sign, compared with the limit that the voltage sets.

mod rise;

use std::f64::consts::FRAC_PI_2;

use self::rise::{Response, Rise};
use super::full_range::for_the_range;
use super::steady::{bring_up, prepared};
use crate::prelude::*;

/// Speeds, rpm on four poles, and the speed above which there is no injection.
const SPEEDS_RPM: [f64; 9] = [0.0, 300.0, 600.0, 800.0, 1200.0, 1800.0, 2100.0, 2700.0, 3600.0];
const WITHOUT_CARRIER_RPM: f64 = 780.0;
/// Height of the step, as a share of the largest q-axis current that drive and voltage permit before it.
const STEP_SHARE: f64 = 0.9;
/// Share of the voltage that the compensation of the dead time leaves.
const USABLE: f64 = 0.97;
/// Time in which flux and limits settle without torque, s.
const SETTLING_S: f64 = 1.0;
/// Time that the figure shows, s.
const SHOWN_S: f64 = 0.012;
/// Delay from a command to its voltage, periods: one, and on average half a period until the next sample.
const DELAY: f64 = 1.5;

/// A step: speed, rpm, and sign of the torque.
type Case = (f64, f64);

/// The measured step, and the physical limit of its rise time, ms.
type Seen = (Rise, f64);

/// Runs the experiment, which is not in the source.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut config = for_the_range(context.config)?;
    config.prepare.learn = true;
    let rig = prepared(&config, context.seed)?;
    let both = |&rpm: &f64| [1.0, -1.0].map(|sign| (config.rpm(rpm), sign));
    let cases: Vec<Case> = SPEEDS_RPM.iter().flat_map(both).collect();
    let seen = context.in_parallel("torque-rise", &cases, |_, &case| step(&config, &rig, case))?;
    let mut outcome = Outcome::default();
    outcome.tables.push(table(&config, &cases, &seen, &mut outcome.metrics));
    outcome.figures.push(figure(&cases, &seen));
    Ok(outcome)
}

/// Does one step at speed.
fn step(config: &Config, rig: &Rig, (rpm, sign): Case) -> Result<Seen, Error> {
    let mut rig = rig.clone();
    bring_up(&mut rig, rpm)?;
    rig.wait(SETTLING_S);
    if let Some(fault) = rig.fault() {
        return Err(Error::Refused(format!("the drive stops at {rpm:.0} rpm: {fault}")));
    }
    let mut start = Point::default();
    rig.run(1.0 / RATE_HZ, |point| start = *point);
    let (m, pole_pairs) = (&config.motor, rig.plant.pole_pairs());
    let physical = Physical {
        resistance: m.r_s,
        leakage: m.l_m + m.l_ls - m.l_m * m.l_m / (m.l_m + m.l_lr),
        speed: rpm * TAU / 60.0 * pole_pairs,
        // (3/2) P L_m/L_r psi is the torque per ampere.
        flux: start.flux * start.torque_per_flux_ampere / (1.5 * pole_pairs),
        voltage: config.inverter.dc_link_v / 3f64.sqrt(),
    };
    let (least, most) = rig.drive.torque_limits().i_q;
    let allowed = f64::from(if sign > 0.0 { most } else { least });
    let i_q = STEP_SHARE * physical.borne(start.id, allowed);
    let limit_ms = 1e3 * (physical.least_s(start.id, 0.9 * i_q) + DELAY / RATE_HZ);
    Ok((Rise::measured(&rig, i_q)?, limit_ms))
}

/// The motor at its stator voltage while the flux is constant: `L di/dt = v - (R + jw L) i - jw psi`, |v| at most `voltage`.
struct Physical {
    resistance: f64,
    leakage: f64,
    /// Electrical speed, rad/s.
    speed: f64,
    flux: f64,
    voltage: f64,
}

impl Physical {
    /// Voltage of a constant current, V.
    fn steady(&self, i: Complex64) -> Complex64 {
        let j_w = Complex64::new(0.0, self.speed);
        (j_w * self.leakage + self.resistance) * i + j_w * self.flux
    }

    /// The largest share of the q-axis current `i_q`, in steps of a hundredth, that [`USABLE`] of the voltage sustains at this flux, A.
    fn borne(&self, i_d: f64, i_q: f64) -> f64 {
        let bears =
            |i_q: &f64| self.steady(Complex64::new(i_d, *i_q)).norm() <= USABLE * self.voltage;
        (0..=100).rev().map(|n| 0.01 * f64::from(n) * i_q).find(bears).unwrap_or(0.0)
    }

    /// The shortest time in which the q-axis current rises from zero to `i_q`, s; the d-axis current is free. By the
    /// maximum principle the voltage of a time T is V e^(j(+-pi/2 + w (T - t))).
    fn least_s(&self, i_d: f64, i_q: f64) -> f64 {
        const STEP_S: f64 = 5e-6;
        let reaches = |steps: &u32| {
            let mut i = Complex64::new(i_d, 0.0);
            for left in (1..=*steps).rev() {
                let angle = FRAC_PI_2.copysign(i_q) + self.speed * (f64::from(left) - 0.5) * STEP_S;
                let voltage = Complex64::from_polar(self.voltage, angle);
                i += (voltage - self.steady(i)) * (STEP_S / self.leakage);
            }
            i.im * i_q.signum() >= i_q.abs()
        };
        (0..4000).find(reaches).map_or(f64::NAN, |steps| f64::from(steps) * STEP_S)
    }
}

fn table(config: &Config, cases: &[Case], seen: &[Seen], m: &mut Metrics) -> Table {
    let trip = f64::from(config.drive.trip_a());
    let ms = |rise: &Rise| rise.current.time_ms(0.9);
    let beyond = |(rise, limit_ms): &Seen| ms(rise) - 1.5 * limit_ms;
    let columns = columns![|n, seen: &Seen|
        "speed (rpm)" => Cell::fixed(cases[n].0, 0);
        "torque current (A)" => Cell::fixed(seen.0.current.end(), 2);
        "90 % after (ms)" => Cell::fixed(ms(&seen.0), 2);
        "limit (ms)" => Cell::fixed(seen.1, 2);
        "ratio" => Cell::fixed(ms(&seen.0) / seen.1, 2);
        "beyond (ms)" => Cell::fixed(beyond(seen), 2);
        "overshoot (%)" => Cell::fixed(100.0 * seen.0.current.overshoot(), 1);
        "largest current (A)" => Cell::fixed(seen.0.peak_a, 2);
        "of the trip (%)" => Cell::fixed(100.0 * seen.0.peak_a / trip, 0);
        "largest angle error (°)" => Cell::fixed(seen.0.angle_deg, 2);
    ];
    let is_free = |(rpm, sign): &Case| *sign > 0.0 && *rpm > config.rpm(WITHOUT_CARRIER_RPM);
    let worst = |free: bool| {
        let of = cases.iter().zip(seen).filter(|(case, _)| is_free(case) == free);
        of.map(|(_, seen)| beyond(seen)).fold(f64::NEG_INFINITY, f64::max)
    };
    let largest =
        |of: &dyn Fn(&Rise) -> f64| seen.iter().map(|(rise, _)| of(rise)).fold(0.0, f64::max);
    m.set("motoring_beyond_ms", worst(true));
    m.set("other_beyond_ms", worst(false));
    m.set("overshoot_pct", 100.0 * largest(&|rise| rise.current.overshoot()));
    m.set("peak_pct_of_trip", 100.0 * largest(&|rise| rise.peak_a / trip));
    m.set("angle_error_max_deg", largest(&|rise| rise.angle_deg));
    Table::of(texts::table("torque-rise", "steps"), &columns, seen.iter().enumerate())
}

fn figure(cases: &[Case], seen: &[Seen]) -> Figure {
    let x = "time after the command (ms)";
    let panel = |sign: f64, label: &str| {
        let of = cases.iter().zip(seen).filter(|((_, known), _)| *known == sign);
        of.fold(Panel::new(x, label), |panel, ((rpm, _), seen)| {
            panel.with(share(&format!("{rpm:.0} rpm"), &seen.0.current))
        })
    };
    Figure::new("rise", "q-axis current after the command, share of the final value", "")
        .panel(panel(1.0, "motoring"))
        .panel(panel(-1.0, "generating"))
}

fn share(name: &str, response: &Response) -> Series {
    let end = response.end();
    let points = response.0.iter().enumerate().take((SHOWN_S * RATE_HZ) as usize);
    Series::line(name, points.map(|(k, value)| (1e3 * k as f64 / RATE_HZ, value / end)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without speed and resistance the current rises linearly, in L i/V. At speed the optimal voltage is faster than
    /// every voltage of constant direction in the frame of the flux, by less than a tenth.
    #[test]
    fn the_physical_limit_is_that_of_simple_cases() {
        let still =
            Physical { resistance: 0.0, leakage: 0.02, speed: 0.0, flux: 0.3, voltage: 180.0 };
        assert!((still.least_s(1.4, 3.0) - 0.02 * 3.0 / 180.0).abs() < 1e-5);
        assert!((still.least_s(1.4, -3.0) - 0.02 * 3.0 / 180.0).abs() < 1e-5);
        let turning = Physical { resistance: 3.0, speed: 400.0, ..still };
        // Any direction that is fixed in the frame of the flux is slower.
        let best = (-90..=90)
            .map(|degrees| {
                let v = Complex64::from_polar(180.0, FRAC_PI_2 + f64::from(degrees).to_radians());
                let (mut i, mut t) = (Complex64::new(1.4, 0.0), 0.0);
                while i.im < 3.0 && t < 0.02 {
                    let j_w = Complex64::new(0.0, 400.0);
                    i += (v - (j_w * 0.02 + 3.0) * i - j_w * 0.3) * (5e-6 / 0.02);
                    t += 5e-6;
                }
                t
            })
            .fold(f64::INFINITY, f64::min);
        let least = turning.least_s(1.4, 3.0);
        assert!(least <= best + 1e-5 && least > 0.9 * best, "{least} {best}");
        // Against the back-EMF it takes longer than with it.
        assert!(least > turning.least_s(1.4, -3.0));
    }
}
