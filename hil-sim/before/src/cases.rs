//! The plants, and the study's results on its own plants.

use hil_sim::experiments::battery::{KINDS, Kind, Summary};

/// A plant, what happens to it, and what to expect.
pub struct Case {
    /// Finding of the study that it stands for.
    pub finding: &'static str,
    /// Plant and tables of the drive.
    pub name: &'static str,
    /// Keys of the bench that make the plant.
    pub set: &'static [&'static str],
    /// Whether the drive learns, and the keys that are set afterwards.
    pub learned: Option<&'static [&'static str]>,
    /// The kinds of runs, which take turns.
    pub kinds: &'static [Kind],
    /// How many runs.
    pub runs: usize,
    /// The study's result.
    pub study: &'static str,
    /// Whether the finding is reproduced.
    pub holds: fn(&Summary) -> bool,
}

fn refused_all(summary: &Summary, fault: u8) -> bool {
    summary.refused.get(&fault) == Some(&summary.runs)
}

fn trips(summary: &Summary) -> usize {
    summary.trips.values().sum()
}

/// The drive with its default tables on the motor that they are made for.
const MODEL_A: Case = Case {
    finding: "",
    name: "model A, default tables",
    set: &[],
    learned: None,
    kinds: &KINDS,
    runs: 48,
    study: "1.86 rms, 10.1 largest; 0 lost, 0 trips (480 runs)",
    holds: |s| s.lost == 0 && trips(s) == 0 && (1.7..2.0).contains(&s.error.rms()),
};

/// All cases, in the order of the findings.
pub const CASES: &[Case] = &[
    Case { runs: 480, ..MODEL_A },
    Case {
        name: "model A, learned",
        learned: Some(&[]),
        runs: 480,
        study: "1.88 rms, 10.6 largest; 0 lost, 0 trips (480 runs)",
        ..MODEL_A
    },
    Case {
        name: "R, learned",
        set: &["plant=r"],
        learned: Some(&[]),
        study: "2.27 rms, 6.3 / 10.7; 0 lost, 0 wrong, 0 flux off, 0 trips",
        holds: |s| s.lost == 0 && (2.0..2.6).contains(&s.error.rms()),
        ..MODEL_A
    },
    Case {
        finding: "1",
        name: "R with the other sign, +3.5 %",
        set: &["plant=r", "iron.teeth=0.035"],
        study: "48 refused by 25",
        holds: |s| refused_all(s, 25),
        ..MODEL_A
    },
    Case {
        finding: "1",
        name: "main flux alone, n = 6, factor 1.3",
        set: &["plant=m6"],
        study: "48 refused by 25",
        holds: |s| refused_all(s, 25),
        ..MODEL_A
    },
    Case {
        finding: "1",
        name: "no saliency",
        set: &["plant=linear"],
        study: "48 refused by 25",
        holds: |s| refused_all(s, 25),
        ..MODEL_A
    },
    Case {
        finding: "2",
        name: "G, learned",
        set: &["plant=g"],
        learned: Some(&[]),
        study: "11.0 rms, 72 / 101; 3 lost, 2 wrong (0.81 s), 2 flux off, trips 11: 3",
        holds: |s| s.lost > 0 && s.wrong.0 > 0 && s.error.rms() > 5.0,
        ..MODEL_A
    },
    Case {
        finding: "2",
        name: "G, learned, load of 0.4 Nm only",
        set: &["plant=g"],
        learned: Some(&[]),
        kinds: &[Kind::Load],
        study: "30 rms, 110 largest; of 8 runs: 6 lost, 3 wrong",
        holds: |s| 2 * s.lost >= s.runs && s.wrong.0 > 0,
        ..MODEL_A
    },
    Case {
        finding: "2, 6",
        name: "G, default tables",
        set: &["plant=g"],
        study: "68 rms, 173 / 180; 25 lost, 11 wrong (1.82 s), 8 flux off (2.7 s), trips 6: 38, 26: 6",
        holds: |s| 2 * s.lost > s.runs && s.wrong.0 > 0 && trips(s) > s.runs / 2,
        ..MODEL_A
    },
    Case {
        finding: "3",
        name: "R, main flux saturated by 2 %, n = 6, learned",
        set: &["plant=r", "iron.saturation=1.02"],
        learned: Some(&[]),
        study: "26 lost, 11 wrong (2.00 s)",
        holds: |s| 4 * s.lost > s.runs && s.wrong.1 > 1.0,
        ..MODEL_A
    },
    Case {
        finding: "3",
        name: "R, main flux saturated by 10 %, n = 6, learned",
        set: &["plant=r", "iron.saturation=1.1"],
        learned: Some(&[]),
        study: "16 wrong (3.38 s)",
        holds: |s| 4 * s.lost > s.runs && s.wrong.1 > 1.0,
        ..MODEL_A
    },
    Case {
        finding: "3",
        name: "G, main flux saturated by 2 %, n = 6, learned",
        set: &["plant=g", "iron.saturation=1.02"],
        learned: Some(&[]),
        study: "20 wrong (2.00 s)",
        holds: |s| 4 * s.lost > s.runs && s.wrong.1 > 1.0,
        ..MODEL_A
    },
    Case {
        finding: "3",
        name: "F, learned",
        set: &["plant=f"],
        learned: Some(&[]),
        study: "48 rms, 152 / 180; 33 lost, 7 wrong (1.12 s), 34 trips",
        holds: |s| 3 * s.lost > s.runs && s.wrong.0 > 0,
        ..MODEL_A
    },
    Case {
        finding: "4",
        name: "R, learned, then cross-talk a from b 0.5 %; 2.25 to 3 A at rest, 6 s",
        set: &["plant=r"],
        learned: Some(&["measurement.cross_talk_a=0.005"]),
        kinds: &[Kind::Hold],
        runs: 64,
        study: "28 of 64 wrong or flux off (1.42 s), trips 6: 24, 26: 8",
        holds: |s| s.flux_off.0 > 0 && trips(s) > 0,
        ..MODEL_A
    },
    Case {
        finding: "4",
        name: "R, learned, then the gain of channel a +0.7 %",
        set: &["plant=r"],
        learned: Some(&["measurement.gain_error_a=0.007"]),
        study: "5.54 rms, 24.6 largest; 5 flux off",
        holds: |s| s.flux_off.0 > 0,
        ..MODEL_A
    },
    Case {
        finding: "5",
        name: "R, cross-talk a from b 0.5 %, learned with it",
        set: &["plant=r", "measurement.cross_talk_a=0.005"],
        learned: Some(&[]),
        study: "7.24 rms, 58.7 largest; 4 flux off, 5 trips",
        holds: |s| s.flux_off.0 > 0 && s.error.rms() > 4.0,
        ..MODEL_A
    },
    Case {
        finding: "5",
        name: "R, cross-talk a from b 2 %, learned with it",
        set: &["plant=r", "measurement.cross_talk_a=0.02"],
        learned: Some(&[]),
        study: "48 refused by 28",
        holds: |s| refused_all(s, 28),
        ..MODEL_A
    },
    Case {
        finding: "6",
        name: "R, default tables",
        set: &["plant=r"],
        study: "68 rms; 18 lost, 2 wrong (0.69 s), 5 flux off, trips 6: 37, 26: 9",
        holds: |s| 4 * s.lost > s.runs && s.wrong.0 > 0 && trips(s) > s.runs / 2,
        ..MODEL_A
    },
];
