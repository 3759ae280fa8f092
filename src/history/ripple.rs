//! Ripple of the dc link. At the load of a run, a capacitor that has aged and a mains phase that is missing both increase it, and then the
//! capacitors carry more current than they are made for.
//!
//! In windows of 20 ms, two periods of the ripple of a two-pulse rectifier at 50 Hz, the lowest voltage is compared with the highest one.
//! Six pulses without any capacitor leave 13 %, so a ripple above the limit shows a two-pulse rectifier with too small a capacitor.

/// Duration of a window, ms.
const WINDOW_MS: u32 = 20;
/// Share of the highest voltage that is missing at the lowest one.
const LIMIT: f32 = 0.15;
/// Number of windows in a row with too much ripple: half a second. A change of the load is over after one or two.
const WINDOWS: u32 = 25;

/// The watch on the ripple.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ripple {
    began_ms: u32,
    /// Lowest and highest voltage of the present window, V; none before the first one.
    seen: Option<(f32, f32)>,
    windows: u32,
}

impl Ripple {
    /// Follows the voltage of the dc link, V, which is none with the outputs off; `now_ms` wraps. Returns whether the ripple has just been
    /// found to be too large.
    pub fn follow(&mut self, now_ms: u32, dc_link: Option<f32>) -> bool {
        let Some(v) = dc_link else {
            *self = Self::default();
            return false;
        };
        let (low, high) = self.seen.map_or((v, v), |(low, high)| (low.min(v), high.max(v)));
        self.seen = Some((low, high));
        if now_ms.wrapping_sub(self.began_ms) < WINDOW_MS {
            return false;
        }
        let large = high - low > LIMIT * high;
        self.windows = if large { self.windows.saturating_add(1) } else { 0 };
        (self.began_ms, self.seen) = (now_ms, None);
        self.windows == WINDOWS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often two seconds of this voltage are reported.
    fn told(volts: impl Fn(f32) -> f32) -> usize {
        let mut ripple = Ripple::default();
        (0..2000).filter(|ms| ripple.follow(*ms, Some(volts(*ms as f32 * 1e-3)))).count()
    }

    #[test]
    fn a_large_ripple_is_told_once_and_a_step_is_not() {
        let two_pulses = |share: f32| move |t: f32| 311.0 * (1.0 - share * (100.0 * t).fract());
        assert_eq!(told(two_pulses(0.17)), 1);
        assert_eq!(told(two_pulses(0.13)), 0);
        // Six pulses without a capacitor, and a load that comes and goes.
        assert_eq!(told(|t| 311.0 * (((300.0 * t).fract() - 0.5) * 1.047).cos()), 0);
        assert_eq!(told(|t| if (5.0 * t).fract() < 0.5 { 311.0 } else { 230.0 }), 0);
    }
}
