//! The plants, and the study's results on its own plants.

use hil_sim::experiments::battery::{Kind, Summary};
use hil_sim::plant::{FAMILIES, IronSettings, PlantSettings};

/// A plant, what happens to it, and what to expect.
pub struct Case {
    /// Finding of the study that it stands for.
    pub finding: &'static str,
    /// Plant and tables of the drive.
    pub name: &'static str,
    /// Family of the iron; none for model A.
    pub family: Option<&'static str>,
    /// Changes the plant before the drive learns.
    pub change: fn(&mut PlantSettings),
    /// Whether the drive learns, and what changes afterwards.
    pub learned: Option<fn(&mut PlantSettings)>,
    /// The kinds of runs; none given: the whole battery.
    pub kinds: &'static [Kind],
    /// The study's result.
    pub study: &'static str,
    /// Whether the finding is reproduced.
    pub holds: fn(&Summary) -> bool,
}

impl Case {
    /// Its plant before the drive learns.
    pub fn plant(&self, base: &PlantSettings) -> anyhow::Result<PlantSettings> {
        let mut plant = *base;
        if let Some(name) = self.family {
            let family = FAMILIES.iter().find(|family| family.name == name);
            let family = family.ok_or_else(|| anyhow::anyhow!("there is no family {name}"))?;
            plant.iron = Some(family.iron);
        }
        (self.change)(&mut plant);
        Ok(plant)
    }
}

const NONE: fn(&mut PlantSettings) = |_| {};

fn iron(plant: &mut PlantSettings) -> &mut IronSettings {
    plant.iron.get_or_insert(IronSettings::LINEAR)
}

fn refused_all(summary: &Summary, fault: u8) -> bool {
    summary.refused.get(&fault) == Some(&summary.runs)
}

fn trips(summary: &Summary) -> usize {
    summary.trips.values().sum()
}

const SOUND: Case = Case {
    finding: "none",
    name: "model A, default tables",
    family: None,
    change: NONE,
    learned: None,
    kinds: &[],
    study: "1.86 rms, 10.1 largest; 0 lost (480 runs)",
    holds: |s| s.lost == 0 && trips(s) == 0 && (1.7..2.0).contains(&s.error.rms()),
};

/// All cases, in the order of the findings.
pub const CASES: &[Case] = &[
    SOUND,
    Case {
        name: "model A, learned",
        learned: Some(NONE),
        study: "1.88 rms, 10.6 largest; 0 lost (480 runs)",
        ..SOUND
    },
    Case {
        name: "R, learned",
        family: Some("r"),
        learned: Some(NONE),
        study: "2.27 rms, 6.3 / 10.7; 0 lost, 0 wrong, 0 trips",
        holds: |s| s.lost == 0 && s.error.rms() < 3.0,
        ..SOUND
    },
    Case {
        finding: "1",
        name: "R, sign +3.5 %",
        family: Some("r"),
        change: |p| iron(p).teeth = 0.035,
        study: "48 refused by 25",
        holds: |s| refused_all(s, 25),
        ..SOUND
    },
    Case {
        finding: "1",
        name: "main flux alone, n = 6, factor 1.3",
        family: Some("m6"),
        study: "48 refused by 25",
        holds: |s| refused_all(s, 25),
        ..SOUND
    },
    Case {
        finding: "1",
        name: "no saliency",
        family: Some("linear"),
        study: "48 refused by 25",
        holds: |s| refused_all(s, 25),
        ..SOUND
    },
    Case {
        finding: "2",
        name: "G, learned",
        family: Some("g"),
        learned: Some(NONE),
        study: "11.0 rms, 72 / 101; 3 lost, 2 wrong (0.81 s), 2 flux off, trips 11: 3",
        holds: |s| s.lost > 0 && s.error.rms() > 4.0,
        ..SOUND
    },
    Case {
        finding: "2",
        name: "G, learned, load steps of 0.4 Nm only",
        family: Some("g"),
        learned: Some(NONE),
        kinds: &[Kind::Load],
        study: "30 rms, 110 largest; of 8: 6 lost, 3 wrong",
        holds: |s| 2 * s.lost >= s.runs && s.wrong.0 > 0,
        ..SOUND
    },
    Case {
        finding: "2",
        name: "G, default tables",
        family: Some("g"),
        study: "68 rms, 173 / 180; 25 lost, 11 wrong (1.82 s), 8 flux off (2.7 s), trips 6: 38, 26: 6",
        holds: |s| 3 * s.lost > s.runs && s.wrong.0 > 0 && trips(s) > s.runs / 2,
        ..SOUND
    },
    Case {
        finding: "3",
        name: "R, main flux saturated by 2 %, learned",
        family: Some("r"),
        change: |p| (iron(p).saturation, iron(p).exponent) = (1.02, 6),
        learned: Some(NONE),
        study: "26 lost, 11 wrong (2.00 s)",
        holds: |s| 4 * s.lost > s.runs && s.wrong.0 > 0,
        ..SOUND
    },
    Case {
        finding: "3",
        name: "R, main flux saturated by 10 %, learned",
        family: Some("r"),
        change: |p| (iron(p).saturation, iron(p).exponent) = (1.10, 6),
        learned: Some(NONE),
        study: "16 wrong (3.38 s)",
        holds: |s| s.wrong.0 > 0 || refused_all(s, 28),
        ..SOUND
    },
    Case {
        finding: "3",
        name: "G, main flux saturated by 2 %, learned",
        family: Some("g"),
        change: |p| (iron(p).saturation, iron(p).exponent) = (1.02, 6),
        learned: Some(NONE),
        study: "20 wrong (2.00 s)",
        holds: |s| s.lost > 0 && s.wrong.0 > 0,
        ..SOUND
    },
    Case {
        finding: "3",
        name: "F, learned",
        family: Some("f"),
        learned: Some(NONE),
        study: "48 rms, 152 / 180; 33 lost, 7 wrong (1.12 s), 34 trips",
        holds: |s| 3 * s.lost > s.runs && s.wrong.0 > 0,
        ..SOUND
    },
    Case {
        finding: "4",
        name: "R, learned, then the gain of a +0.7 %",
        family: Some("r"),
        learned: Some(|p| p.measurement.gain_error_a = 0.007),
        study: "5.54 rms, 24.6 largest; 5 flux off",
        holds: |s| s.flux_off.0 > 0,
        ..SOUND
    },
    Case {
        finding: "4",
        name: "R, learned, then the gain of a +0.7 %; reversals of 3 A at rest only",
        family: Some("r"),
        learned: Some(|p| p.measurement.gain_error_a = 0.007),
        kinds: &[Kind::Reversals],
        study: "not given",
        holds: |_| true,
        ..SOUND
    },
    Case {
        finding: "6",
        name: "R, default tables",
        family: Some("r"),
        study: "68 rms; 18 lost, 2 wrong (0.69 s), 5 flux off, trips 6: 37, 26: 9",
        holds: |s| trips(s) > s.runs / 2,
        ..SOUND
    },
];
