//! Figure 11: the spectrum of the current difference before and after the band-pass.

use drive_core::filter::{BPF, SosState};
use rand_distr::{Distribution, Uniform};

use crate::prelude::*;

/// Number of samples of a spectrum: 1 s, so that its lines are 1 Hz apart.
const SAMPLES: usize = RATE as usize;
const CARRIER_HZ: f64 = 600.0;
/// The band of the arbitrary signal, Hz.
const BAND: std::ops::RangeInclusive<u32> = 20..=180;

/// Adds the figure and its metrics.
pub fn add(context: &Context<'_>, outcome: &mut Outcome) {
    let signal = signal(context.seed);
    let carrier = |k: usize| (omega_t(CARRIER_HZ) * k as f64).cos();
    let product: Vec<f64> = signal.iter().enumerate().map(|(k, a)| a * carrier(k)).collect();
    let mut state = SosState::default();
    // The signal repeats every second; the output has settled after the first second.
    let filtered: Vec<f64> = (product.iter().chain(&product))
        .map(|&x| f64::from(BPF.step(&mut state, x as f32)))
        .skip(SAMPLES)
        .collect();

    let carrier: Vec<f64> = (0..SAMPLES).map(carrier).collect();
    let [a, c, p, f] = [&signal, &carrier, &product, &filtered].map(|x| spectrum(x));
    let at = |spectrum: &[(f64, f64)], hz: f64| spectrum[hz as usize].1;
    let middle = f64::from((BAND.start() + BAND.end()) / 2);
    let sideband = at(&p, CARRIER_HZ + middle) / at(&a, middle);
    outcome.metrics.set("sideband_over_signal", sideband);
    let lower = at(&p, CARRIER_HZ - middle) / at(&a, middle);
    let holds = (sideband - 0.5).abs() < 0.01 && (lower - 0.5).abs() < 0.01;
    outcome.compared.push(named("side_bands").of_print(holds));
    for (key, offset) in [("inner", *BAND.start()), ("outer", *BAND.end())] {
        let offset = f64::from(offset);
        for (side, hz) in [("lower", CARRIER_HZ - offset), ("upper", CARRIER_HZ + offset)] {
            let gain = 20.0 * (at(&f, hz) / at(&p, hz)).log10();
            outcome.metrics.set(format!("bpf_{side}_{key}_edge_db"), gain);
        }
    }
    let metric = |name: &str| outcome.metrics.get(name).unwrap_or(f64::NAN);
    let values = [
        ("far", f64::from(*BAND.end())),
        ("far_below", -metric("bpf_lower_outer_edge_db")),
        ("far_above", -metric("bpf_upper_outer_edge_db")),
        ("near", f64::from(*BAND.start())),
        ("near_below", -metric("bpf_lower_inner_edge_db")),
        ("near_above", -metric("bpf_upper_inner_edge_db")),
    ];
    texts::add_remarks(outcome, "modulation", &values);

    let gain = (0..=1000).map(f64::from).map(|hz| (hz, BPF.response(omega_t(hz)).norm())).collect();
    let panel = || Panel::new("frequency (Hz)", "amplitude").y_range(0.0, 1.1);
    let (behind, gain) = (Series::line("behind BPF", f), Series::reference("gain of BPF", gain));
    let figure = texts::figure("modulation", "spectrum")
        .panel(panel().with(Series::line("A", a)).with(Series::line("carrier", c)))
        .panel(panel().with(Series::line("A times carrier", p)))
        .panel(panel().with(behind).with(gain));
    outcome.figures.push(figure);
}

/// Makes lines of 1 Hz spacing over the band, highest at its low end, with arbitrary phases.
fn signal(seed: u64) -> Vec<f64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let phases = Uniform::new(0.0, TAU);
    let width = f64::from(BAND.end() - BAND.start());
    let line = |hz: u32| {
        let amplitude = 1.0 - 0.6 * f64::from(hz - BAND.start()) / width;
        let phase = phases.map_or(0.0, |phases| phases.sample(&mut random));
        (omega_t(f64::from(hz)), amplitude, phase)
    };
    let lines: Vec<_> = BAND.map(line).collect();
    let at = |k: usize| {
        lines.iter().map(|(w, amplitude, phase)| amplitude * (w * k as f64 + phase).cos()).sum()
    };
    (0..SAMPLES).map(at).collect()
}

/// Amplitude over Hz, up to 1 kHz, by direct summation: a single transform needs no fast algorithm.
fn spectrum(signal: &[f64]) -> Vec<(f64, f64)> {
    let turn = |k: usize| Complex64::from_polar(2.0 / SAMPLES as f64, omega_t(k as f64));
    let turns: Vec<Complex64> = (0..SAMPLES).map(turn).collect();
    let line = |hz: usize| {
        let terms = signal.iter().enumerate().map(|(k, x)| turns[hz * k % SAMPLES] * x);
        (hz as f64, terms.sum::<Complex64>().norm())
    };
    (0..=1000).map(line).collect()
}
