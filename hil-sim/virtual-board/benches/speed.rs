//! Processor time per simulated second while the drive regulates torque, with the motor in the loop; the goals are 0.12
//! s without and 0.2 s with counting of cycles.

use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use drive_core::State;
use hil_sim::Config;
use rustix::time::{ClockId, clock_gettime};
use virtual_board::{Counting, Image, Options};

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/common/pair.rs"]
mod pair;

use pair::Pair;

/// Processor time of this process, so that other programs do not count.
fn processor_time() -> Duration {
    Duration::try_from(clock_gettime(ClockId::ProcessCPUTime)).expect("is not negative")
}

fn one_second(c: &mut Criterion) {
    let mut group = c.benchmark_group("one simulated second");
    group.sample_size(10);
    for (name, cycles) in [("no counting", false), ("cycles counted", true)] {
        let image = Image::built().expect("type `cargo firmware` first");
        let mut options = Options::new(&Config::default(), 1);
        options.counting = Counting { cycles, every_instruction: false };
        let mut pair = Pair::new(image, options).expect("starts");
        pair.order("start torque").expect("is taken");
        pair.until_state(State::Torque).expect("regulates");
        pair.order("torque 1").expect("is taken");
        group.bench_function(name, |b| {
            b.iter_custom(|seconds| {
                let began = processor_time();
                for _ in 0..seconds {
                    pair.board.run_periods(6000).expect("goes on");
                    while pair.board.next_period().is_some() {}
                }
                processor_time() - began
            });
        });
    }
    group.finish();
}

criterion_group!(benches, one_second);
criterion_main!(benches);
