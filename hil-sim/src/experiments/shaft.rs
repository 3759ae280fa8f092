//! Drop of a free shaft's speed at a load step, compared with an encoder and with the bound that the delay of the loop sets.

use crate::prelude::*;

/// Largest full load, as a share of the torque that the drive allows.
const SHARE_OF_ALLOWED_TORQUE: f64 = 0.9;
/// Loads as shares of the full load, which is at most the rated torque; speeds as shares of the rated speed.
const LOADS: [f64; 4] = [0.5, -0.5, 1.0, -1.0];
const SPEEDS: [f64; 4] = [0.0, 0.05, 0.2, 0.8];
/// Inertias relative to the inertia in the drive's settings.
const INERTIAS: [f64; 3] = [0.5, 2.0, 10.0];
/// Resonances of a coupling between two equal inertias, Hz, and its damping ratio.
const COUPLINGS_HZ: [f64; 3] = [15.0, 30.0, 60.0];
const DAMPING: f64 = 0.007;
/// Rise time of the load of a hoist, time before the load, and observed time from the beginning of the load, s.
const HOIST_S: f64 = 2.0;
const BEFORE_S: f64 = 1.0;
const AFTER_S: f64 = 3.0;
/// Longest run-up, s.
const RUN_UP_S: f64 = 60.0;
/// Band within which the speed has recovered, as a share of the rated speed.
const RECOVERED: f64 = 0.02;
/// Period of the injection, s, over which means of speed and torque are taken.
const MEAN_S: f64 = 10.0 / RATE_HZ;

/// A load on a shaft.
#[derive(Clone, Copy, Debug)]
struct Case {
    /// Share of the load, its rise time, s, and the speed as a share of the rated speed.
    load: f64,
    ramp_s: f64,
    speed: f64,
    /// True inertia relative to the inertia in the settings; resonance of the coupling, Hz.
    inertia: f64,
    coupling_hz: Option<f64>,
}

/// Response of the speed to a load; a run that ends in a fault, or does not start, has no numbers.
#[derive(Clone, Copy, Debug)]
struct Response {
    /// Largest deviation, rpm, and its area, percent of the rated speed times s; both are positive in the direction of the load.
    dip_rpm: f64,
    area_pct_s: f64,
    /// Time after which the speed stays within the band, s.
    recovery_s: f64,
    /// Deviation of the torque before the load and at the end, percent of the rated torque.
    noise_pct: [f64; 2],
    /// Largest angle error, degrees.
    angle_deg: f64,
    /// The load as a share of the rated torque.
    load: f64,
    fault: Option<Fault>,
}

impl Response {
    /// Puts the same number in each place.
    fn of(x: f64) -> Self {
        let (noise_pct, load, fault) = ([x; 2], x, None);
        Self { dip_rpm: x, area_pct_s: x, recovery_s: x, noise_pct, angle_deg: x, load, fault }
    }

    /// Describes how the run ended.
    fn end(&self) -> String {
        self.fault.map_or("runs".to_owned(), |fault| format!("fault {}", fault.code()))
    }
}

impl Case {
    const STEP: Self = Self { load: 0.5, ramp_s: 0.0, speed: 0.8, inertia: 1.0, coupling_hz: None };

    /// Returns all cases.
    fn all() -> Vec<Self> {
        let speeds = |case: Self| SPEEDS.map(|speed| Self { speed, ..case });
        let steps = LOADS.iter().flat_map(|&load| speeds(Self { load, ..Self::STEP }));
        let hoist = Self { ramp_s: HOIST_S, speed: 0.0, ..Self::STEP };
        let inertias = INERTIAS.iter().flat_map(|&inertia| speeds(Self { inertia, ..Self::STEP }));
        let couplings = COUPLINGS_HZ
            .iter()
            .flat_map(|&hz| speeds(Self { coupling_hz: Some(hz), ..Self::STEP }));
        steps.chain([hoist]).chain(inertias).chain(couplings).collect()
    }

    fn name(&self) -> String {
        match self.coupling_hz {
            Some(hz) => format!("coupling {hz:.0} Hz"),
            None if self.inertia != 1.0 => format!("inertia x {}", self.inertia),
            None if self.ramp_s > 0.0 => "hoist".to_owned(),
            None => "step".to_owned(),
        }
    }

    /// Makes the bench; its load acts behind the coupling.
    fn bench(&self, config: &Config, source: AngleSource) -> Config {
        let mut config = config.clone();
        config.drive.angle_source = source;
        // The rule for this limit gives a far lower value with an encoder.
        config.drive.speed.limit_rpm.get_or_insert(config.drive.nameplate.speed_rpm);
        config.prepare.learn = true;
        config.load.mode = LoadMode::Free;
        config.load.torque_nm = Some(0.0);
        config.motor.inertia *= self.inertia;
        if let Some(hz) = self.coupling_hz {
            let (half, omega) = (0.5 * config.motor.inertia, TAU * hz);
            (config.motor.inertia, config.shaft.load_inertia) = (half, half);
            // Stiffness for two equal halves that oscillate against each other.
            config.shaft.stiffness = 0.5 * half * omega * omega;
            config.shaft.damping = DAMPING * half * omega;
        }
        config
    }

    /// Computes the response of a drive with this angle source.
    fn response(&self, config: &Config, source: AngleSource, seed: u64) -> Result<Response, Error> {
        let (rated_nm, rated_rpm) = (config.rated_nm(), rated_rpm(config));
        let mut rig = Rig::from_config(&self.bench(config, source), seed)?;
        if or_refusal(rig.start(Mode::Speed))?.is_err() {
            return Ok(Response { fault: rig.drive.state().fault(), ..Response::of(f64::NAN) });
        }
        let (wanted, band) = (self.speed * rated_rpm, RECOVERED * rated_rpm);
        rig.command(&Command::Speed(wanted as f32))?;
        let runs_up = |rig: &Rig| (rig.rpm() - wanted).abs() > band && rig.fault().is_none();
        while runs_up(&rig) && rig.time() < RUN_UP_S {
            rig.wait(0.1);
        }
        rig.wait(BEFORE_S);
        let mut seen = Response::of(0.0);
        let (mut torque, mut speed) = (Stats::default(), Stats::default());
        let mut last = Mean::default();
        for _ in 0..steps(BEFORE_S) {
            last = Mean::of(&mut rig, &mut torque, &mut speed);
        }
        let before = speed;
        seen.noise_pct[0] = 100.0 * torque.deviation() / rated_nm;
        let room = rig.drive.torque_limits().i_q;
        let allowed = f64::from((-room.0).min(room.1)) * last.torque_per_ampere;
        seen.load = self.load * (SHARE_OF_ALLOWED_TORQUE * allowed / rated_nm).min(1.0);
        let direction = self.load.signum();
        let start = rig.time();
        for step in 0..steps(AFTER_S + self.ramp_s) {
            let t = rig.time() - start;
            let share = if self.ramp_s > 0.0 { (t / self.ramp_s).min(1.0) } else { 1.0 };
            rig.set_load(Load::Free { torque: share * seen.load * rated_nm })?;
            if step == steps(AFTER_S + self.ramp_s - BEFORE_S) {
                torque = Stats::default();
            }
            let mean = Mean::of(&mut rig, &mut torque, &mut speed);
            seen.angle_deg = seen.angle_deg.max(mean.angle_deg);
            let dip_rpm = direction * (before.mean() - mean.rpm);
            seen.dip_rpm = seen.dip_rpm.max(dip_rpm);
            seen.area_pct_s += 100.0 * dip_rpm / rated_rpm * MEAN_S;
            if dip_rpm.abs() > band {
                seen.recovery_s = t + MEAN_S;
            }
        }
        seen.noise_pct[1] = 100.0 * torque.deviation() / rated_nm;
        let fault = rig.drive.state().fault();
        let figures = if fault.is_none() { seen } else { Response::of(f64::NAN) };
        Ok(Response { fault, load: seen.load, ..figures })
    }
}

/// Means over a period of the injection, and the largest angle error, degrees.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    rpm: f64,
    torque_per_ampere: f64,
    angle_deg: f64,
}

impl Mean {
    fn of(rig: &mut Rig, torques: &mut Stats, speeds: &mut Stats) -> Self {
        let (mut mean, mut torque) = (Self::default(), Stats::default());
        rig.run(MEAN_S, |p| {
            torque.push(p.torque);
            mean.rpm += p.speed_rpm * MEAN_S.recip() / RATE_HZ;
            mean.torque_per_ampere = p.torque_per_flux_ampere * p.flux;
            mean.angle_deg = mean.angle_deg.max(p.angle_error_deg.abs());
        });
        torques.push(torque.mean());
        speeds.push(mean.rpm);
        mean
    }
}

fn rated_rpm(config: &Config) -> f64 {
    f64::from(config.drive.nameplate.speed_rpm)
}

fn steps(seconds: f64) -> usize {
    (seconds / MEAN_S).round() as usize
}

/// Runs the experiment, which is not in the source.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let (config, seed) = (context.config, context.seed);
    let cases = Case::all();
    let seen = context.in_parallel("shaft", &cases, |_, case| {
        let of = |source| case.response(config, source, seed);
        Ok([of(AngleSource::Injection)?, of(AngleSource::Encoder)?])
    })?;
    let loops = config.drive.motion_loops().map_err(Error::refused)?;
    let rated_rpm = rated_rpm(config);
    // Starting time from torque and inertia of the settings: s from rest to the rated speed.
    let mechanical_s =
        f64::from(config.drive.inertia()) * rated_rpm * TAU / 60.0 / config.rated_nm();
    let bound_rpm = |(case, [seen, _]): &(&Case, &[Response; 2])| {
        seen.load.abs() * loops.delay_s() / (mechanical_s * case.inertia) * rated_rpm
    };
    let mut outcome = Outcome::default();
    let pairs: Vec<(&Case, &[Response; 2])> = cases.iter().zip(&seen).collect();
    let columns = columns![|_, pair: &(&Case, &[Response; 2])|
        "shaft" => Cell::from(pair.0.name());
        "speed (rpm)" => Cell::fixed(pair.0.speed * rated_rpm, 0);
        "load (%)" => Cell::fixed_or_dash(100.0 * pair.1[0].load, 0);
        "speed falls by (rpm)" => Cell::fixed_or_dash(pair.1[0].dip_rpm, 1);
        "with an encoder (rpm)" => Cell::fixed_or_dash(pair.1[1].dip_rpm, 1);
        "bound (rpm)" => Cell::fixed_or_dash(bound_rpm(pair), 1);
        "area (%s)" => Cell::fixed_or_dash(pair.1[0].area_pct_s, 2);
        "with an encoder (%s)" => Cell::fixed_or_dash(pair.1[1].area_pct_s, 2);
        "back within 2 % (s)" => Cell::fixed_or_dash(pair.1[0].recovery_s, 2);
        "torque noise before (%)" => Cell::fixed_or_dash(pair.1[0].noise_pct[0], 2);
        "after (%)" => Cell::fixed_or_dash(pair.1[0].noise_pct[1], 2);
        "largest angle error (°)" => Cell::fixed_or_dash(pair.1[0].angle_deg, 1);
        "ends" => Cell::from(pair.1[0].end());
        "with an encoder" => Cell::from(pair.1[1].end());
    ];
    let table = texts::table("shaft", "loads");
    outcome.tables.push(Table::of(table, &columns, pairs.iter().enumerate()));
    outcome.faults.extend(pairs.iter().filter_map(|(case, [seen, _])| {
        let fault = seen.fault?;
        let (name, load, speed) = (case.name(), 100.0 * case.load, 100.0 * case.speed);
        Some(format!("{name}, {load:.0} % at {speed:.0} %: {}", fault_text(fault)))
    }));
    let of = |is: &dyn Fn(&Case) -> bool| -> Vec<[Response; 2]> {
        pairs.iter().filter(|(case, _)| is(case)).map(|(_, seen)| **seen).collect()
    };
    let is_plain = |case: &Case| case.inertia == 1.0 && case.coupling_hz.is_none();
    let half = of(&|case| is_plain(case) && case.load == 0.5 && case.speed == 0.8);
    let plain = of(&is_plain);
    let largest = |of: &[[Response; 2]], value: &dyn Fn(&[Response; 2]) -> f64| {
        of.iter().map(value).fold(f64::NAN, f64::max)
    };
    let m = &mut outcome.metrics;
    m.set("area_half_load_pct_s", largest(&half, &|r| r[0].area_pct_s));
    m.set("dip_half_load_rpm", largest(&half, &|r| r[0].dip_rpm));
    m.set("dip_half_load_to_encoder", largest(&half, &|r| r[0].dip_rpm / r[1].dip_rpm));
    m.set("hoist_dip_rpm", largest(&of(&|case| case.ramp_s > 0.0), &|r| r[0].dip_rpm));
    let rest = of(&|case| is_plain(case) && case.speed == 0.0);
    m.set("torque_noise_at_rest_pct", largest(&rest, &|r| r[0].noise_pct[0]));
    m.set("angle_error_max_deg", largest(&plain, &|r| r[0].angle_deg));
    let coupled = of(&|case| case.coupling_hz.is_some());
    m.set("torque_noise_coupled_pct", largest(&coupled, &|r| r[0].noise_pct[1]));
    m.set("stopped_runs", outcome.faults.len() as f64);
    Ok(outcome)
}
