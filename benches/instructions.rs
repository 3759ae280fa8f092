//! Instructions of one control step and of one sample of the recursive least squares, counted by
//! valgrind: exact and repeatable, where wall time is not:
//! `cargo bench -p induction-drive-benches --bench instructions --features instructions`.
//!
//! Needs valgrind and `cargo install gungraun-runner --version =0.20.0`. The counts are those of the
//! host's instruction set: they tell one version of the code from another, not the cycles of the target.

#![expect(missing_docs, reason = "the macros make public items")]

use std::hint::black_box;

use drive_core::{AlphaBeta, Command, Drive, Measured, Mode};
use gungraun::{library_benchmark, library_benchmark_group, main};
use hil_sim::Config;
use hil_sim::rig::Rig;
use rotor_id::rls::{Rls, RlsSettings};

/// A drive that regulates 1.5 A without a sensor, and its next input.
fn regulating() -> (Drive, Measured) {
    let mut rig = Rig::from_config(&Config::default(), 1).expect("the default rig");
    rig.start(Mode::Torque).expect("a start");
    rig.command(&Command::Torque(1.5)).expect("a reference");
    rig.run(0.5, |_| {});
    let sample = rig.plant.sample();
    let measured = rig.drive.front_end().measure(&mut rig.front_end, &sample, rig.drive.offsets());
    (rig.drive, measured)
}

/// Voltage and current of a sample: what they are makes no difference to the count.
fn signals(n: u32) -> (AlphaBeta, AlphaBeta) {
    let x = 0.02 * n as f32;
    let v = AlphaBeta::new(180.0 * x.cos(), 180.0 * x.sin());
    (v + AlphaBeta::new(20.0 * (5.3 * x).cos(), 0.0), AlphaBeta::new(9.0 * x.sin(), -9.0 * x.cos()))
}

/// Estimating, its filters settled, and the next sample.
fn estimating() -> (Rls, AlphaBeta, AlphaBeta) {
    let mut rls = Rls::new(RlsSettings::paper(180.0, 30.0)).expect("the paper's settings");
    for n in 0..5000 {
        let (v, i) = signals(n);
        rls.step(v, i);
    }
    let (v, i) = signals(5000);
    (rls, v, i)
}

#[library_benchmark(setup = regulating)]
fn drive_step((mut drive, measured): (Drive, Measured)) -> Drive {
    black_box(drive.step(black_box(&measured)));
    drive
}

#[library_benchmark(setup = estimating)]
fn rls_sample((mut rls, v, i): (Rls, AlphaBeta, AlphaBeta)) -> Rls {
    rls.step(black_box(v), black_box(i));
    rls
}

library_benchmark_group!(name = control, benchmarks = [drive_step, rls_sample]);
main!(library_benchmark_groups = control);
