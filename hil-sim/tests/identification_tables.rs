//! The tables of the paper: their reproduction (T1), and the machine with which they were made (T2).

use std::sync::LazyLock;

use hil_sim::identification::Parameters;
use hil_sim::identification::printed::Case;
use hil_sim::identification::study::{Entry, Errors, errors};
use hil_sim::identification::trial::Noise;
use hil_sim::outcome::Origin;
use hil_sim::{Config, Outcome, experiments};

const TRIALS: u64 = 60;

fn entries(errors: &[Errors]) -> Vec<Entry> {
    let both = |e: &Errors| e.entries(&["A", "B", "C", "D", "S"]);
    errors.iter().flat_map(both).filter(|e| e.printed_pct.is_some()).collect()
}

fn share(entries: &[Entry]) -> f64 {
    entries.iter().filter(|e| e.within(2.0)).count() as f64 / entries.len() as f64
}

/// All twelve columns of the machine PX with seed 1 and half the printed noise.
static HALF: LazyLock<Vec<Errors>> = LazyLock::new(|| all(Parameters::PX, Noise::HALF, 1, TRIALS));

/// All twelve columns.
fn all(machine: Parameters, noise: Noise, seed: u64, trials: u64) -> Vec<Errors> {
    Case::all().into_iter().map(|case| errors(machine, case, noise, seed, trials)).collect()
}

#[test]
fn t1_tables() {
    let entries = entries(&HALF);
    assert_eq!(entries.len(), 186);
    assert!(share(&entries) >= 0.55, "{}", share(&entries));
    for e in &entries {
        if e.model == "B" && e.case.period > 0 && ["tau_r", "l_s"].contains(&e.parameter) {
            assert!(e.within(1.6), "{e:?}");
        }
    }
}

/// Mean error in %: speed 375 or 61, signal 0 (S_g) or 1 (S_s), period, model B, C, D, S, parameter.
fn error(
    errors: &[Errors],
    fast: bool,
    signal: usize,
    period: usize,
    model: usize,
    k: usize,
) -> f64 {
    errors[if fast { 0 } else { 6 } + 3 * signal + period].continuous[model][k]
}

#[test]
fn t1_orderings() {
    const B: usize = 0;
    const C: usize = 1;
    let printed = all(Parameters::PX, Noise::PRINTED, 1, TRIALS);
    for (noise, errors) in [(Noise::HALF, &*HALF), (Noise::PRINTED, &printed)] {
        let at = |fast, signal, period, model, k| error(errors, fast, signal, period, model, k);
        for period in 0..3 {
            for signal in 0..2 {
                // Model C beats B on tau_r, sigma_l_s and l_s at high speed.
                for k in 1..4 {
                    assert!(at(true, signal, period, C, k) < at(true, signal, period, B, k));
                }
                // The imaginary part of h_1 is never estimated.
                for first in [0, 6] {
                    assert!(errors[first + 3 * signal + period].discrete[5] > 100.0);
                }
            }
            // At low speed S_s beats S_g on every parameter.
            for k in 0..5 {
                assert!(at(false, 1, period, C, k) < at(false, 0, period, C, k), "{k} {period}");
            }
        }
        // The errors of f_1 and f_0 grow with the period, that of h_1b falls.
        for first in [0, 3, 6, 9] {
            for k in [0, 2, 5] {
                let e = [0, 1, 2].map(|period| errors[first + period].discrete[k]);
                let rising = e[0] < e[1] && e[1] < e[2];
                let falling = e[0] > e[1] && e[1] > e[2];
                assert!(if k == 5 { falling } else { rising }, "{first} {k} {e:?}");
            }
        }
        if noise == Noise::HALF {
            // At low speed and 50 us, C is no better than B. r_s is the worst parameter of Model C at 50 and 100 us,
            // and sigma_l_s the best at high speed.
            for k in [0, 1, 3, 4] {
                let ratio = at(false, 1, 0, C, k) / at(false, 1, 0, B, k);
                assert!((0.5..2.0).contains(&ratio), "{k}: {ratio}");
            }
            for (fast, signal, period) in
                [true, false].into_iter().flat_map(|f| [(f, 0, 0), (f, 0, 1), (f, 1, 0), (f, 1, 1)])
            {
                for k in 1..5 {
                    let (r_s, other) =
                        (at(fast, signal, period, C, 0), at(fast, signal, period, C, k));
                    assert!(r_s > other, "{fast} {signal} {period} {k}");
                }
            }
            for (signal, period) in [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)] {
                for k in [0, 1, 3, 4] {
                    assert!(at(true, signal, period, C, 2) < at(true, signal, period, C, k));
                }
            }
            // Model S has less than half a percent of speed error with S_s, and is better than C in the mean.
            for k in 0..5 {
                let mean =
                    |model: usize| errors.iter().map(|e| e.continuous[model][k]).sum::<f64>();
                assert!(mean(3) < mean(C), "{k}");
            }
        }
    }
}

#[test]
fn t2_the_machine_by_ratios_that_do_not_depend_on_the_noise() {
    for ratio in hil_sim::identification::ratios::all() {
        // |h_0b / h_1b|, (1 - f_11) / 2 and the error of tau_r by Model B, PX within 13, 3 and 10 %.
        let (px, rbv) = (ratio.px / ratio.printed, ratio.rbv / ratio.printed);
        let (near, far) = match ratio.quantity {
            "h_0b / h_1b" => ((px - 1.0).abs() < 0.13, (1.7..2.3).contains(&rbv)),
            "(1 - f_11) / 2" => ((px - 1.0).abs() < 0.035, (0.7..0.77).contains(&rbv)),
            _ => ((px - 1.0).abs() < 0.12, (0.6..0.8).contains(&rbv)),
        };
        assert!(near && far, "{ratio:?}");
    }
}

fn outcome(name: &str, seed: u64) -> Outcome {
    experiments::run(name, &Config::default(), seed).expect("runs")
}

#[test]
fn the_json_table_has_one_row_for_every_number() {
    let text = outcome("identify-continuous", 1)
        .to_json("identify-continuous", &Origin::new(1, &[]))
        .expect("JSON");
    let object: serde_json::Value = serde_json::from_str(&text).expect("one object");
    let rows = object["compared"].as_array().expect("rows");
    // 90 cells, and the claim about 0 to 200 rad/s.
    assert_eq!(rows.len(), 91);
    let row = rows.iter().find(|r| r["place"] == "Table 5, r_s" && r["quantity"] == "Ss 200 us");
    let seeds = row.expect("a row of Table 5")["seeds"].as_array().expect("the spread").clone();
    assert!(seeds[0].as_f64() < seeds[1].as_f64());
    assert_eq!(object["table"][0]["title"], "Mean of both signals, speeds and all periods");
    let discrete = outcome("identify-discrete", 1);
    assert_eq!(discrete.compared.len(), 96);
    // Only the seed makes a difference.
    let ours = |outcome: &Outcome| outcome.compared[0].simulated;
    assert_eq!(ours(&discrete), ours(&outcome("identify-discrete", 1)));
    assert_ne!(ours(&discrete), ours(&outcome("identify-discrete", 2)));
}
