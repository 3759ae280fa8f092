//! Ranges and tick marks of axes.

/// An axis: its range in drawing units, and where its marks are.
///
/// Drawing units are the values themselves, or their decimal logarithms on a logarithmic axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Lower end, drawing units.
    pub low: f64,
    /// Upper end, drawing units.
    pub high: f64,
    /// Marks in drawing units, with what is written beside them.
    pub ticks: Vec<(f64, String)>,
}

impl Axis {
    /// A linear axis for these data, with about `count` marks; `exact` keeps the ends where they
    /// are, otherwise they move out to leave some air.
    pub fn linear(low: f64, high: f64, count: usize, exact: bool) -> Self {
        Self::with_steps(low, high, count, exact, nice_step)
    }

    /// Likewise for an angle in degrees.
    pub fn degrees(low: f64, high: f64, count: usize, exact: bool) -> Self {
        Self::with_steps(low, high, count, exact, nice_angle)
    }

    fn with_steps(low: f64, high: f64, count: usize, exact: bool, nice: fn(f64) -> f64) -> Self {
        let (low, high) = spread(low, high);
        let air = if exact { 0.0 } else { 0.04 * (high - low) };
        let (low, high) = (low - air, high + air);
        let step = nice((high - low) / count.max(1) as f64);
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let huge = low.abs().max(high.abs()) >= 1e6 || decimals > 6;
        // Data that end just before a mark get it too: 4.9998 s is 5 s.
        let nearly = 2e-3 * (high - low) / step;
        let first = (low / step - nearly).ceil() as i64;
        let last = (high / step + nearly).floor() as i64;
        let ticks = (first..=last).map(|k| {
            let value = k as f64 * step;
            let text = if k == 0 {
                "0".to_owned()
            } else if huge {
                format!("{value:.2e}")
            } else {
                format!("{value:.decimals$}")
            };
            (value.clamp(low, high), text.replace('-', "\u{2212}"))
        });
        Self { low, high, ticks: ticks.collect() }
    }

    /// A logarithmic axis for these data, which must be above zero; marks at 1, 2, 5 or at the
    /// decades.
    pub fn logarithmic(low: f64, high: f64) -> Self {
        let (low, high) =
            spread(low.max(f64::MIN_POSITIVE).log10(), high.max(f64::MIN_POSITIVE).log10());
        let factors: &[f64] = if high - low < 3.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let mut ticks = Vec::new();
        for decade in low.floor() as i32..=high.ceil() as i32 {
            for factor in factors {
                let value = factor * 10_f64.powi(decade);
                if (low - 1e-9..=high + 1e-9).contains(&value.log10()) {
                    let text =
                        if decade < -3 { format!("{value:.0e}") } else { format!("{value}") };
                    ticks.push((value.log10(), text));
                }
            }
        }
        Self { low, high, ticks }
    }
}

/// A range that is not empty and is finite.
fn spread(low: f64, high: f64) -> (f64, f64) {
    if !low.is_finite() || !high.is_finite() || low > high {
        return (0.0, 1.0);
    }
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-6);
    if high - low > least {
        (low, high)
    } else {
        (low - 0.5 * low.abs().max(1e-3), high + 0.5 * high.abs().max(1e-3))
    }
}

/// 1, 2 or 5 times a power of ten, as near to `wanted` as there is one.
fn nice_step(wanted: f64) -> f64 {
    let decade = 10_f64.powf(wanted.log10().floor());
    let factors = [10.0, 5.0, 2.0, 1.0];
    factors.into_iter().find(|f| f * decade <= 1.45 * wanted).unwrap_or(1.0) * decade
}

/// Likewise for angles in degrees, where large steps divide the turn.
fn nice_angle(wanted: f64) -> f64 {
    let steps = [360.0, 180.0, 90.0, 45.0, 30.0];
    steps.into_iter().find(|step| *step <= 1.45 * wanted).unwrap_or_else(|| nice_step(wanted))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|(_, text)| text.as_str()).collect()
    }

    #[test]
    fn marks_are_round_and_inside() {
        assert_eq!(
            texts(&Axis::linear(0.0, 1.0, 5, true)),
            ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            texts(&Axis::linear(-35.0, 12.0, 5, true)),
            ["\u{2212}30", "\u{2212}20", "\u{2212}10", "0", "10"]
        );
        assert_eq!(texts(&Axis::logarithmic(1.0, 1000.0)).len(), 10);
        assert_eq!(
            texts(&Axis::logarithmic(0.01, 1e4)),
            ["0.01", "0.1", "1", "10", "100", "1000", "10000"]
        );
    }

    #[test]
    fn angles_are_divided_as_angles() {
        let axis = Axis::degrees(-180.0, 179.9, 9, true);
        assert_eq!(
            axis.ticks.iter().map(|t| t.1.as_str()).collect::<Vec<_>>()[4..],
            ["0", "45", "90", "135", "180"]
        );
    }

    #[test]
    fn no_data_and_constant_data_still_give_an_axis() {
        for (low, high) in
            [(f64::INFINITY, f64::NEG_INFINITY), (3.0, 3.0), (0.0, 0.0), (f64::NAN, 1.0)]
        {
            let axis = Axis::linear(low, high, 5, false);
            assert!(axis.high > axis.low && axis.ticks.len() >= 2, "{axis:?}");
        }
    }
}
