//! The error caused by single precision.

use rand_distr::{Distribution, Uniform};

use super::compared::ComparedFilter;
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
) -> Result<Table, Error> {
    let cases: Vec<(usize, usize)> = (0..3).flat_map(|s| (0..3).map(move |i| (s, i))).collect();
    let measured = context.in_parallel("filters", &cases, |_, &(filter, number)| {
        Ok(filters[filter].errors(&mut *input(number, context.seed), samples))
    })?;
    let heads = ["filter", "form", INPUTS[0], INPUTS[1], INPUTS[2], "largest of all"];
    let mut table =
        Table::new("Error against double precision, mA rms, and the largest error, mA", &heads);
    for (filter, inputs) in filters.iter().zip(measured.chunks(3)) {
        for (form, (name, key, _)) in inputs[0].iter().enumerate() {
            let rms = inputs.iter().map(|input| input[form].2.rms());
            let largest = inputs.iter().map(|input| input[form].2.largest()).fold(0.0, f64::max);
            let worst = rms.clone().fold(0.0, f64::max);
            let key = format!("{}_{key}", filter.name.to_lowercase());
            outcome.metrics.set(format!("{key}_error_rms_a"), worst);
            outcome.metrics.set(format!("{key}_error_max_a"), largest);
            let rms = rms.map(|rms| Cell::significant(1e3 * rms, 2));
            let cells = [Cell::from(filter.name), Cell::from(*name)].into_iter().chain(rms);
            table.row(cells.chain([Cell::significant(1e3 * largest, 2)]));
        }
    }
    Ok(table.note(format!("{samples} samples at 6 kHz. One count of the ADC is 2.2 mA.")))
}
