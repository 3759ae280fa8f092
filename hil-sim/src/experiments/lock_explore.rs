//! Throw-away.
use std::f64::consts::TAU;
use std::fmt::Write;
use drive_core::{Command, Mode, State};
use rayon::prelude::*;
use super::{Context, Experiment};
use crate::config::LoadMode;
use crate::error::Error;
use crate::outcome::Outcome;
use crate::plant::Load;
use crate::rig::Rig;

pub const EXPERIMENT: Experiment =
    Experiment { name: "lock-explore", stands_for: "", about: "throw-away", run };

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut cases = vec![];
    let n = context.config.extent.runs.unwrap_or(2);
    for offset in [0.0_f64, 90.0, -90.0, 120.0, -120.0, 180.0] {
        for iq in [0.5, 1.0, 2.0, 3.0, -0.5, -1.0, -2.0, -3.0] {
            for rpm in [0.0, 30.0, -30.0, 150.0, -150.0, 300.0, -300.0] {
                for k in 0..n {
                    cases.push((offset, iq, rpm, context.seed + u64::from(k) * 7919));
                }
            }
        }
    }
    let bar = context.progress.bar("x", cases.len() as u64);
    let texts = cases.par_iter().enumerate().map(|(id, &(offset, iq, rpm, seed))| {
        let mut config = context.config.clone();
        config.load.mode = LoadMode::Speed;
        config.load.speed_rpm = 0.0;
        let mut s = crate::rig::drive_settings(&config); s.injection.synchronous.allowed_loss = if std::env::var("TRIP").is_ok() { s.injection.synchronous.allowed_loss } else {90.0}; let ramp_s: f64 = std::env::var("RAMP").ok().and_then(|x| x.parse().ok()).unwrap_or(600.0);
        let mut rig = Rig::new(&crate::rig::plant_settings(&config), &s, seed + id as u64)?;
        rig.start(Mode::Torque)?;
        let mut c0 = 0.0;
        rig.run(0.15, |_| {});
        rig.run(0.1, |p| c0 += p.carrier / 600.0);
        let mut peak = 0.0_f64;
        let steps = (f64::abs(rpm) / ramp_s * 100.0).ceil() as u32;
        for n in 1..=steps {
            let speed = rpm * TAU / 60.0 * f64::from(n) / f64::from(steps);
            rig.set_load(Load::Speed { speed })?;
            rig.run(0.01, |p| peak = peak.max(p.loss));
        }
        let peak_ramp = peak; rig.run(0.2, |_| {});
        rig.command(Command::Torque(iq as f32))?;
        peak = 0.0;
        rig.run(0.5, |p| peak = peak.max(p.loss));
        let peak_step = peak;
        rig.run(0.3 + (id % 10) as f64 * 0.0137, |_| {});
        let mut text = String::new();
        let t0 = rig.time() + 0.3;
        let mut acc = [0.0; 8];
        let mut count = 0;
        let fault = |rig: &Rig| match rig.drive.state() { State::Fault(f) => f.code(), _ => 0 };
        for part in 0..2 {
            let secs = if part == 0 { 0.3 } else { context.seconds.unwrap_or(1.5) };
            let mut rows = vec![];
            rig.run(secs, |p| {
                let v = [p.angle_error_deg, p.flux, p.saliency, { let _ = c0; p.loss }, p.speed_estimate_rpm, p.speed_rpm, p.iq_ref, p.torque];
                for (a, v) in acc.iter_mut().zip(v) { *a += v / 60.0; }
                acc[0] = p.angle_error_deg;
                count += 1;
                if count == 60 { rows.push((p.t - t0, acc)); acc = [0.0; 8]; count = 0; }
            });
            for (t, r) in rows {
                let _ = write!(text, "{id},{offset},{iq},{rpm},{t:.4}");
                for v in r { let _ = write!(text, ",{v:.5}"); }
                let _ = writeln!(text, ",{},{peak_step:.4},{peak_ramp:.4}", fault(&rig));
            }
            if part == 0 { rig.plant.turn_rotor_flux(offset.to_radians()); }
        }
        bar.advance(1);
        Ok(text)
    }).collect::<Result<Vec<String>, Error>>()?;
    std::fs::write(std::env::var("OUT").unwrap_or("/tmp/lock.csv".into()), texts.concat()).ok();
    Ok(Outcome::default())
}
