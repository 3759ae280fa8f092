//! Input filter of the estimation, omega_n³ / (s + omega_n)³ (Eq. 44), as three first-order sections
//! discretised by Tustin's rule. It also provides the increment of its output.
//!
//! Own code instead of second-order sections: the increment must be computed before it is rounded into the
//! output.

use num_complex::Complex32;

/// Filter of one vector. The increment of the output is computed directly instead of as a difference of two
/// rounded outputs: at 10 Hz and 20 kHz it is 0.3 % of the output.
#[derive(Clone, Copy, Debug, Default)]
pub struct Filter {
    gain: f32,
    input: Complex32,
    sections: [Complex32; 3],
}

/// Output of the filter.
#[derive(Clone, Copy, Debug, Default)]
pub struct Filtered {
    /// The output.
    pub value: Complex32,
    /// The output minus the previous output.
    pub change: Complex32,
}

impl Filter {
    /// Filter at rest; `corner` is omega_n h, rad/sample.
    pub fn new(corner: f32) -> Self {
        Self { gain: corner / (2.0 + corner), ..Self::default() }
    }

    /// Filters one sample with at most 18 multiplications and additions per axis and no division.
    pub fn step(&mut self, x: Complex32) -> Filtered {
        let (mut now, mut before) = (x, self.input);
        self.input = x;
        let mut change = Complex32::ZERO;
        for y in &mut self.sections {
            change = ((now - *y) + (before - *y)) * self.gain;
            before = *y;
            *y += change;
            now = *y;
        }
        Filtered { value: now, change }
    }
}
