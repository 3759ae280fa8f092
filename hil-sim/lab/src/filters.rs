//! The three digital filters: their response, and their error in single precision.

mod compared;
mod design;
mod direct;
mod precision;

use drive_core::filter::{BPF, LPF_AS_PRINTED, PP, Section, Sos};
use drive_settings::tuning::bisected;

use crate::prelude::*;
use crate::recomputed::CARRIER_HZ;
use compared::{ComparedFilter, filters};
use design::{Band, Prototype, butterworth, chebyshev_1, chebyshev_2, elliptic, ripple};

/// Time for which each filter gets input, s.
const SECONDS: f64 = 100.0;

/// Runs the experiment: Figure 30, Tables 7 and 8.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let samples = (context.seconds.unwrap_or(SECONDS) * RATE) as u64;
    let filters = filters();
    let mut outcome = Outcome::default();
    outcome.figures.push(bode(&filters));
    characteristics(&filters, &mut outcome);
    recomputed(&filters, &mut outcome);
    let errors = precision::errors(&filters, samples, context, &mut outcome)?;
    outcome.tables.push(errors);
    let direct = outcome.metrics.get("lpf_direct_1_error_rms_a").unwrap_or(f64::NAN);
    outcome.compared.push(named("filters_sensitive").recomputed(direct > 1e-3));
    let worst = |quantity: &str| {
        let forms = ["direct_1", "direct_2", "transposed_2"]
            .map(|form| ["lpf", "pp"].map(|f| format!("{f}_{form}_{quantity}")));
        let values = forms.iter().flatten().filter_map(|name| outcome.metrics.get(name));
        1e3 * values.fold(0.0, f64::max)
    };
    let values = [("rms_ma", worst("error_rms_a")), ("largest_ma", worst("error_max_a"))];
    texts::add_remarks(&mut outcome, "filters", &values);
    Ok(outcome)
}

fn bode(filters: &[ComparedFilter]) -> Figure {
    let hz = frequencies(10.0, 2990.0, 1500);
    let bode = Bode { hz: &hz, label: "frequency (Hz)", shown: |hz| hz };
    let (gain, phase) =
        bode.panels(filters.iter().map(|f| (f.name, |omega_t: f64| f.sections(omega_t))));
    let (printed, lag) =
        bode.panels(filters.iter().map(|f| ("", |omega_t: f64| f.direct(omega_t))));
    let dashed = |mut panel: Panel, printed: Panel| {
        let dashed = |series| Series { style: Style::Reference, ..series };
        panel.series.extend(printed.series.into_iter().map(dashed));
        panel.series[3].name = "Tables 7, 8 in f64".into();
        panel
    };
    let (gain, phase) = (dashed(gain, printed), dashed(phase, lag));
    texts::figure("filters", "bode").panel(gain.y_range(-100.0, 5.0)).panel(phase)
}

fn characteristics(filters: &[ComparedFilter], outcome: &mut Outcome) {
    let w = omega_t(CARRIER_HZ);
    for filter in filters {
        let key = filter.name.to_lowercase();
        for (name, value) in
            [("dc_gain", filter.sections(0.0).re), ("gain_600hz_db", decibels(filter.sections(w)))]
        {
            outcome.metrics.set(format!("{key}_{name}"), value);
        }
    }
}

/// Returns the frequencies in Hz at which the gain of a filter has this value in dB.
pub(super) fn edges_hz<const N: usize>(filter: &Sos<N>, level: f64) -> Vec<f64> {
    crossings(|hz| decibels(filter.response(omega_t(hz))) - level)
}

/// Compares the coefficients of Tables 7 and 8, from the specification and in the drive, and the other statements of section 3.10.
fn recomputed(filters: &[ComparedFilter], outcome: &mut Outcome) {
    let corner = printed("section 3.10", "cut-off frequency of PP");
    let (lpf, bpf, pp) = (elliptic(4, 0.5, 40.0), elliptic(2, 0.5, 40.0), elliptic(4, 0.5, 60.0));
    let designs = [
        ("Table 7", lpf.digital(Band::Stop(450.0, 650.0)), expanded(&LPF_AS_PRINTED.sections)),
        ("Table 8", bpf.digital(Band::Pass(500.0, 700.0)), expanded(&BPF.sections)),
        ("Table 8", pp.digital(Band::Low(corner)), expanded(&PP.sections)),
    ];
    for (filter, (table, design, drive)) in filters.iter().zip(designs) {
        let mut largest = 0.0_f64;
        for (part, name) in ["b", "a"].into_iter().enumerate() {
            for (i, (&value, &used)) in design[part].iter().zip(&drive[part]).enumerate() {
                let quantity = format!("{name} ({})", filter.name);
                let ours = beside(&format!("{table}, i = {i}"), &quantity);
                let but = Some(("the digits of the design tool", 1e-4));
                outcome.compared.push(Compared { but, ..ours }.recomputed(value).used(used));
                largest = largest.max((value - filter.printed[part][i]).abs());
            }
        }
        let key = filter.name.to_lowercase();
        outcome.metrics.set(format!("{key}_design_differs_by"), largest);
        let order = drive[1].len() - 1;
        let place = beside("section 3.10", &format!("order of {}", filter.name));
        outcome.compared.push(place.recomputed(order as f64));
    }
    let [pass, stop] = [edges_hz(&BPF, -0.6), edges_hz(&LPF_AS_PRINTED, -40.0)];
    let stop = [stop[0], stop[stop.len() - 1]];
    outcome.metrics.set("lpf_stop_from_hz", stop[0]);
    outcome.metrics.set("lpf_stop_to_hz", stop[1]);
    outcome.metrics.set("carrier_from_edge_hz", stop[1] - CARRIER_HZ);
    // The specification of PP: the lowest order of the other filter types that meets it.
    let edges = crossings(|hz| decibels(filters[2].direct(omega_t(hz))) + 60.0);
    let edge = edges.first().copied().unwrap_or(f64::NAN);
    let warped = |hz: f64| (0.5 * omega_t(hz)).tan();
    let ratio = warped(edge) / warped(corner);
    // Group delay near dc, samples.
    let w = 1e-4;
    let response =
        |prototype: Prototype| direct::response(&prototype.digital(Band::Low(corner)), w);
    let delay = |prototype: Prototype| -response(prototype).arg() / w;
    let elliptic = delay(pp);
    let stop_edge = ((ripple(60.0) / ripple(0.5)).acosh() / 6.0).cosh();
    let delays = [
        ("butterworth", delay(butterworth(9, 0.5))),
        ("chebyshev_1", delay(chebyshev_1(6, 0.5))),
        ("chebyshev_2", delay(chebyshev_2(6, 60.0, ratio))),
        // The same order with its slack in the stop band: exactly 0.5 dB at 100 Hz.
        ("chebyshev_2_pass", delay(chebyshev_2(6, 60.0, stop_edge))),
    ];
    outcome.metrics.set("pp_stop_from_hz", edge);
    outcome.metrics.set("elliptic_delay_samples", elliptic);
    for (name, delay) in delays {
        outcome.metrics.set(format!("{name}_delay_samples"), delay);
    }
    let fewest = delays[1].1.min(delays[2].1);
    let within = pass[0] < stop[0] && stop[1] < pass[1];
    outcome.compared.extend([
        named("stop_band_has_carrier").recomputed((stop[0]..stop[1]).contains(&CARRIER_HZ)),
        named("pass_band_has_stop_band").recomputed(within),
        named("less_delay_than_butterworth").recomputed(elliptic < delays[0].1),
        named("less_delay_than_chebyshev").recomputed(elliptic < fewest),
    ]);
    outcome.metrics.set("lpf_currents_high_by_pct", 100.0 * (1.0 / LPF_AS_PRINTED.dc_gain() - 1.0));
    outcome.metrics.set("bpf_gain_dc_db", 20.0 * BPF.dc_gain().log10());
    outcome.metrics.set("leak_of_an_ampere_ma", 1e3 * BPF.dc_gain());
}

/// Multiplies sections to one numerator and one denominator.
fn expanded(sections: &[Section]) -> [Vec<f64>; 2] {
    let product = |of: fn(&Section) -> [f32; 3]| {
        sections.iter().fold(vec![1.0], |whole, section| {
            let mut next = vec![0.0; whole.len() + 2];
            for (k, x) in whole.iter().enumerate() {
                for (n, c) in of(section).into_iter().enumerate() {
                    next[k + n] += x * f64::from(c);
                }
            }
            next
        })
    };
    [product(|s| [s.b0, s.b1, s.b2]), product(|s| [1.0, s.a1, s.a2])]
}

/// Returns the frequencies in Hz at which `f` changes its sign.
fn crossings(f: impl Fn(f64) -> f64) -> Vec<f64> {
    let grid: Vec<f64> = (1..3000).map(|k| f64::from(k) + 0.123).collect();
    let is_positive = |hz: f64| f(hz) > 0.0;
    let changes = grid.windows(2).filter(|pair| is_positive(pair[0]) != is_positive(pair[1]));
    let crossing = |pair: &[f64]| {
        let begins = is_positive(pair[0]);
        bisected((pair[0], pair[1]), 40, &|hz| is_positive(hz) == begins).0
    };
    changes.map(crossing).collect()
}
