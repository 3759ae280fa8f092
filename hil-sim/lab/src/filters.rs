//! The three digital filters: response, and error in single precision.

mod compared;
mod direct;
mod precision;

use drive_core::filter::LPF;
use num_complex::Complex64;
use sim_bench::bode::{Bode, RATE, decibels, frequencies, omega_t};
use sim_bench::prelude::*;

use compared::{ComparedFilter, filters};

/// Figure 30, Tables 7 and 8.
pub const EXPERIMENT: Experiment = Experiment {
    name: "filters",
    stands_for: "Figure 30, Tables 7, 8",
    about: "Response of the three elliptic filters, and their error in single precision as \
            second-order sections and in the printed direct form.",
    uses: &[&["seconds"]],
    not: &[],
    run,
};

/// How long each filter is fed, s.
const SECONDS: f64 = 100.0;

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let samples = (context.seconds.unwrap_or(SECONDS) * RATE) as u64;
    let filters = filters();
    let mut outcome = Outcome::default();
    outcome.figures.push(bode(&filters));
    outcome.figures.push(stop_band(filters[0].as_ref()));
    let table = characteristics(&filters, &mut outcome);
    outcome.tables.push(table);
    outcome.tables.push(edges(&filters));
    let errors = precision::errors(&filters, samples, context, &mut outcome);
    outcome.tables.push(errors);
    outcome.remark(
        "Tables 7 and 8 hold elliptic designs without a misprint. \"LPF\" is a band stop: it \
         passes everything above 650 Hz and is no filter against noise or aliases. Its gain at dc \
         is 0.944, which makes every real current 5.9 % too large; the drive divides by it.",
    );
    outcome.remark(
        "\"BPF\" attenuates dc by 40 dB only: of a current of 1 A, 10 mA come through, as much as \
         the signal that the demodulation of the source looks for (see injection-map).",
    );
    let worst = |quantity: &str| {
        let forms = ["direct_1", "direct_2", "transposed_2"]
            .map(|form| ["lpf", "pp"].map(|f| format!("{f}_{form}_{quantity}")));
        let values = forms.iter().flatten().filter_map(|name| outcome.metrics.get(name));
        1e3 * values.fold(0.0, f64::max)
    };
    outcome.remarks.push(format!(
        "In single precision and in the printed direct form (Eq. C.1), LPF and PP are wrong by up \
         to {:.0} mA rms and {:.0} mA at worst: more than the 10 mA of the signal. The drive runs \
         second-order sections.",
        worst("error_rms_a"),
        worst("error_max_a"),
    ));
    Ok(outcome)
}

fn bode(filters: &[Box<dyn ComparedFilter + Send>]) -> Figure {
    let hz = frequencies(10.0, 2990.0, 1500);
    let bode = Bode { hz: &hz, label: "frequency (Hz)", shown: |hz| hz };
    let (gain, phase) =
        bode.panels(filters.iter().map(|f| (f.name(), |omega_t: f64| f.sections(omega_t))));
    Figure::new("bode", "The digital filters, as the drive computes them", "Figure 30")
        .panel(gain.y_range(-100.0, 5.0))
        .panel(phase)
}

fn stop_band(lpf: &dyn ComparedFilter) -> Figure {
    let along = |response: &dyn Fn(f64) -> Complex64| {
        (0..=900)
            .map(|k| 440.0 + f64::from(k) * 0.25)
            .map(|hz| (hz, decibels(response(omega_t(hz)))))
            .collect()
    };
    let panel = Panel::new("frequency (Hz)", "gain (dB)")
        .y_range(-80.0, 5.0)
        .with(Series::line("sections, f32", along(&|w| lpf.sections(w))))
        .with(Series::line("direct form, f32 coefficients", along(&|w| lpf.direct_rounded(w))))
        .with(Series::reference("Table 7, f64", along(&|w| lpf.direct(w))));
    Figure::new(
        "stop-band",
        "Stop band of LPF, and what is left of it when the coefficients of Table 7 are rounded to \
         single precision",
        "Table 7",
    )
    .panel(panel)
}

fn characteristics(filters: &[Box<dyn ComparedFilter + Send>], outcome: &mut Outcome) -> Table {
    let mut table = Table::new("Responses", &[]);
    for filter in filters {
        let w = omega_t(600.0);
        let [pole, pole_rounded] = filter.largest_poles();
        let delay = Cell::fixed(filter.group_delay(0.0), 2);
        let (printed, sections) = (decibels(filter.direct(w)), decibels(filter.sections(w)));
        let rows = [
            ("Tables 7, 8, f64", filter.direct(0.0), printed, Cell::from(""), Cell::fixed(pole, 6)),
            ("sections, f32", filter.sections(0.0), sections, delay, Cell::from("")),
            (
                "direct form, f32",
                filter.direct_rounded(0.0),
                decibels(filter.direct_rounded(w)),
                Cell::from(""),
                Cell::fixed(pole_rounded, 6),
            ),
        ];
        for (form, dc, carrier, delay, pole) in rows {
            let dc = Cell::fixed(dc.re, 5);
            table.record([
                ("filter", filter.name().into()),
                ("form", form.into()),
                ("gain at dc", dc),
                ("gain at 600 Hz (dB)", Cell::fixed(carrier, 2)),
                ("group delay at dc (samples)", delay),
                ("largest pole |z|", pole),
            ]);
        }
        let key = filter.name().to_lowercase();
        outcome.metrics.set(format!("{key}_dc_gain"), filter.sections(0.0).re);
        outcome.metrics.set(format!("{key}_gain_600hz_db"), sections);
        outcome
            .metrics
            .set(format!("{key}_gain_600hz_f32_direct_db"), decibels(filter.direct_rounded(w)));
        outcome.metrics.set(format!("{key}_group_delay_dc_samples"), filter.group_delay(0.0));
    }
    let divided = decibels(LPF.response(omega_t(600.0)));
    table.note(format!(
        "Divided by its gain at dc, as the drive uses it, LPF has {divided:.2} dB at 600 Hz."
    ))
}

fn edges(filters: &[Box<dyn ComparedFilter + Send>]) -> Table {
    let levels = [-0.6, -3.0, -20.0, -40.0];
    let heads = ["filter", "-0.6 dB at (Hz)", "-3 dB at (Hz)", "-20 dB at (Hz)", "-40 dB at (Hz)"];
    let mut table = Table::new("Edges", &heads);
    for filter in filters {
        let crossings = levels.map(|level| {
            let found = crossings(|hz| decibels(filter.sections(omega_t(hz))) - level);
            Cell::from(found.iter().map(|hz| format!("{hz:.1}")).collect::<Vec<_>>().join(", "))
        });
        table.row([Cell::from(filter.name())].into_iter().chain(crossings));
    }
    table.note("The ripple of the pass bands is 0.5 dB: each filter is measured against 0 dB.")
}

/// Frequencies in Hz where `f` changes its sign.
fn crossings(f: impl Fn(f64) -> f64) -> Vec<f64> {
    let grid: Vec<f64> = (1..3000).map(|k| f64::from(k) + 0.123).collect();
    let mut found = Vec::new();
    for pair in grid.windows(2) {
        let (mut low, mut high) = (pair[0], pair[1]);
        if (f(low) > 0.0) == (f(high) > 0.0) {
            continue;
        }
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if (f(low) > 0.0) == (f(middle) > 0.0) { low = middle } else { high = middle }
        }
        found.push(low);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim_bench::config::Config;
    use sim_bench::progress::Progress;

    /// Sections in single precision are as good as exact, the direct form is useless (a tenth of
    /// the samples that the experiment takes; `seconds` takes more).
    #[test]
    fn precision() {
        let config = Config::default();
        let context = Context {
            config: &config,
            seed: 1,
            seconds: Some(10.0),
            progress: Progress::hidden(),
            file: None,
        };
        let outcome = run(&context).unwrap();
        let metric = |name: &str| outcome.metrics.get(name).unwrap();
        for filter in ["lpf", "bpf", "pp"] {
            assert!(metric(&format!("{filter}_sections_error_rms_a")) <= 2e-5, "{filter}");
            assert!(metric(&format!("{filter}_sections_error_max_a")) <= 1e-4, "{filter}");
        }
        for filter in ["lpf", "pp"] {
            for form in ["direct_1", "direct_2", "transposed_2"] {
                assert!(
                    metric(&format!("{filter}_{form}_error_rms_a")) >= 0.8e-3,
                    "{filter} {form}"
                );
            }
        }
        assert!(metric("lpf_gain_600hz_db") <= -48.0);
        for (filter, gain) in [("lpf", 0.94406), ("bpf", 0.01), ("pp", 0.94406)] {
            assert!((metric(&format!("{filter}_dc_gain")) - gain).abs() < 1e-4, "{filter}");
        }
    }
}
