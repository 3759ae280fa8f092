//! The error that single precision causes.

use rand_distr::{Distribution, Uniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use sim_bench::bode::omega_t;

use super::compared::{ComparedFilter, SECTIONS_F32};

use crate::prelude::*;

/// The inputs of the error measurement, A.
const INPUTS: [&str; 3] = ["white, ±3 A", "3 A dc", "3 A 3.7 Hz + 0.26 A 600 Hz"];

fn input(number: usize, seed: u64) -> Box<dyn FnMut() -> f64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut k = -1.0;
    match (number, Uniform::new(-3.0, 3.0)) {
        (0, Ok(white)) => Box::new(move || white.sample(&mut random)),
        (1, _) => Box::new(|| 3.0),
        _ => Box::new(move || {
            k += 1.0;
            3.0 * (omega_t(3.7) * k).sin() + 0.26 * (omega_t(600.0) * k).cos()
        }),
    }
}

/// Feeds each filter with each input; adds the metrics and returns the table.
pub fn errors(
    filters: &[ComparedFilter],
    samples: u64,
    context: &Context<'_>,
    outcome: &mut Outcome,
) -> Table {
    let bar = context.progress.bar("filters", 9);
    let cases: Vec<(usize, usize)> = (0..3).flat_map(|s| (0..3).map(move |i| (s, i))).collect();
    let measured: Vec<_> = cases
        .par_iter()
        .map(|&(filter, number)| {
            let errors = filters[filter].errors(&mut *input(number, context.seed), samples);
            bar.advance(1);
            errors
        })
        .collect();
    let heads = ["filter", "form", INPUTS[0], INPUTS[1], INPUTS[2], "largest of all"];
    let mut table =
        Table::new("Error against double precision, mA rms, and the largest error, mA", &heads);
    for (filter, inputs) in filters.iter().zip(measured.chunks(3)) {
        for form in 0..inputs[0].len() {
            let name = inputs[0][form].0;
            let rms = inputs.iter().map(|input| input[form].1.rms());
            let largest = inputs.iter().map(|input| input[form].1.largest()).fold(0.0, f64::max);
            let worst = rms.clone().fold(0.0, f64::max);
            let key = filter.name.to_lowercase();
            let suffix = if name == SECTIONS_F32 {
                "sections"
            } else {
                ["direct_1", "direct_2", "transposed_2"][form - 1]
            };
            outcome.metrics.set(format!("{key}_{suffix}_error_rms_a"), worst);
            outcome.metrics.set(format!("{key}_{suffix}_error_max_a"), largest);
            let rms = rms.map(|rms| Cell::significant(1e3 * rms, 2));
            let cells = [Cell::from(filter.name), Cell::from(name)].into_iter().chain(rms);
            table.row(cells.chain([Cell::significant(1e3 * largest, 2)]));
        }
    }
    table.note(format!("{samples} samples at 6 kHz. One step of the converter is 2.2 mA."))
}
