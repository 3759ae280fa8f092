//! The cases: each kind in the regions of the speed for which it is intended.

use crate::prelude::*;

/// Limits of the regions, rpm on four poles. The angle comes from the injection alone up to 450 rpm and from the
/// back-EMF above 600 rpm. The injection is off above 750 rpm, and field weakening is active in the last region.
const REGIONS_RPM: [f64; 9] = [0.0, 150.0, 350.0, 550.0, 750.0, 1200.0, 1800.0, 2700.0, 3600.0];
/// Speed of the kinds that use only one, rpm.
pub const ONE_RPM: f64 = 1800.0;

/// A kind in a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// The kind.
    pub kind: RangeKind,
    /// Lower and upper limit, rpm on four poles.
    pub region: (f64, f64),
}

impl Case {
    /// Returns all cases of one kind, or of all.
    pub fn all(only: RangeKind) -> Vec<Self> {
        let is_chosen =
            |kind: &RangeKind| *kind != RangeKind::All && [RangeKind::All, *kind].contains(&only);
        let kinds = RangeKind::VALUES.iter().copied().filter(is_chosen);
        let of = |kind| Self::regions(kind).into_iter().map(move |region| Self { kind, region });
        kinds.flat_map(of).collect()
    }

    fn regions(kind: RangeKind) -> Vec<(f64, f64)> {
        let all = REGIONS_RPM.windows(2).map(|ends| (ends[0], ends[1]));
        match kind {
            one if has_one_speed(one) => vec![(0.0, ONE_RPM)],
            RangeKind::Sag => all.filter(|region| region.0 >= 1200.0).collect(),
            _ => all.collect(),
        }
    }

    /// Returns the name for metrics: `constant_550_750`.
    pub fn name(&self) -> String {
        let kind = self.kind.word().replace('-', "_");
        format!("{kind}_{}_{}", self.region.0, self.region.1)
    }

    /// Returns the name in words.
    pub fn words(&self) -> String {
        format!("{}, {} to {} rpm", self.kind.word(), self.region.0, self.region.1)
    }

    /// Returns a random speed in the region, of either sign, rpm on four poles; or the speed of the kinds that use only one.
    pub fn speed(&self, random: &mut impl Rng) -> f64 {
        let speed = random.random_range(self.region.0..=self.region.1);
        sign(random) * if has_one_speed(self.kind) { ONE_RPM } else { speed }
    }
}

/// Whether the runs of a kind use only one speed, which the drive regulates.
fn has_one_speed(kind: RangeKind) -> bool {
    matches!(kind, RangeKind::Ramps | RangeKind::HotRamps | RangeKind::Braking | RangeKind::Outage)
}
