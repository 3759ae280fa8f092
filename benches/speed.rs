//! Wall time of the control step, alone and with the motor: `cargo bench -p induction-drive-benches`.
//! The motor alone is in `plant.rs`.
//!
//! The machines it runs on are noisy: compare figures of one run only. Real time is 6000 periods a
//! second, so `real time / (time of "drive and motor")` is how many times faster than real time a
//! simulation runs.

use criterion::{Criterion, criterion_group, criterion_main};
use drive_core::{Command, Measured, Mode};
use hil_sim::Config;
use hil_sim::rig::Rig;
use std::hint::black_box;

/// A rig that regulates 1.5 A, sensorless or with the encoder, with the default plant.
fn rig(changes: &[&str]) -> Rig {
    let config = Config::load(None, None, changes).expect("keys of the configuration");
    let mut rig = Rig::from_config(&config, 1).expect("the default rig");
    rig.start(Mode::Torque).expect("a start");
    rig.command(&Command::Torque(1.5)).expect("a reference");
    rig.run(0.5, |_| {});
    rig
}

fn speed(c: &mut Criterion) {
    let variants: [(&str, &[&str]); 2] =
        [("sensorless", &[]), ("encoder", &["angle_source=encoder"])];
    for (name, changes) in variants {
        // A second of recorded samples, replayed from the state in which the recording began.
        let mut recorder = rig(changes);
        let begin = recorder.drive.clone();
        let inputs: Vec<Measured> = (0..6000)
            .map(|_| {
                let sample = recorder.plant.sample();
                let mut front_end = recorder.front_end;
                let drive = &recorder.drive;
                let measured = drive.front_end().measure(&mut front_end, &sample, drive.offsets());
                recorder.step_with(&sample);
                measured
            })
            .collect();
        c.bench_function(&format!("Drive::step, {name}, 6000 periods"), |b| {
            b.iter_batched_ref(
                || begin.clone(),
                |drive| {
                    for measured in &inputs {
                        black_box(drive.step(black_box(measured)));
                    }
                },
                criterion::BatchSize::SmallInput,
            );
        });
        c.bench_function(&format!("drive and motor, {name}, 6000 periods"), |b| {
            let mut rig = rig(changes);
            b.iter(|| (0..6000).for_each(|_| rig.step()));
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = speed
}
criterion_main!(benches);
