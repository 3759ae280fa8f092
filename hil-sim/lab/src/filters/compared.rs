//! The filters, each in the forms that are compared.

use drive_core::filter::{BPF, LPF_AS_PRINTED, PP, Sos, SosState};
use num_complex::Complex64;
use sim_bench::bode::largest_pole;
use sim_bench::prelude::*;

use super::direct;

/// A filter whose forms are compared: responses, and the error of each form.
pub trait ComparedFilter: Sync {
    /// Its name in the source.
    fn name(&self) -> &'static str;
    /// Frequency response of the sections the drive runs.
    fn sections(&self, omega_t: f64) -> Complex64;
    /// Frequency response by Tables 7 and 8.
    fn direct(&self, omega_t: f64) -> Complex64;
    /// Likewise, with coefficients rounded to `f32`.
    fn direct_rounded(&self, omega_t: f64) -> Complex64;
    /// Largest pole of the direct form: as printed, rounded to `f32`.
    fn largest_poles(&self) -> [f64; 2];
    /// Group delay in samples.
    fn group_delay(&self, omega_t: f64) -> f64;
    /// Errors against `f64`, A: for each form its name and statistics.
    fn errors(&self, input: &mut dyn FnMut() -> f64, samples: u64) -> Vec<(&'static str, Stats)>;
}

struct Filter<const SECTIONS: usize, const TAPS: usize> {
    name: &'static str,
    sections: Sos<SECTIONS>,
    direct: [[f64; TAPS]; 2],
}

impl<const SECTIONS: usize, const TAPS: usize> ComparedFilter for Filter<SECTIONS, TAPS> {
    fn name(&self) -> &'static str {
        self.name
    }
    fn sections(&self, omega_t: f64) -> Complex64 {
        self.sections.response(omega_t)
    }
    fn direct(&self, omega_t: f64) -> Complex64 {
        direct::response(&self.direct, omega_t)
    }
    fn direct_rounded(&self, omega_t: f64) -> Complex64 {
        direct::response(&direct::rounded(&self.direct), omega_t)
    }
    fn largest_poles(&self) -> [f64; 2] {
        [self.direct, direct::rounded(&self.direct)].map(|[_, a]| largest_pole(&a[1..]))
    }
    fn group_delay(&self, omega_t: f64) -> f64 {
        let (h, at) = (1e-5, |w| self.sections.response(w));
        -(at(omega_t + h) / at(omega_t - h)).arg() / (2.0 * h)
    }
    fn errors(&self, input: &mut dyn FnMut() -> f64, samples: u64) -> Vec<(&'static str, Stats)> {
        let (sections, mut state) = (self.sections, SosState::default());
        let sections = Box::new(move |x: f32| sections.step(&mut state, x));
        let mut forms: Vec<direct::Form> = vec![(SECTIONS_F32, sections)];
        forms.extend(direct::f32_forms(self.direct));
        let mut reference = direct::reference(self.direct);
        let mut errors = vec![Stats::default(); forms.len()];
        for _ in 0..samples {
            // All forms get the same f32 input.
            let x = input() as f32;
            let exact = reference(f64::from(x));
            for ((_, form), error) in forms.iter_mut().zip(&mut errors) {
                error.push(f64::from(form(x)) - exact);
            }
        }
        forms.iter().map(|(name, _)| *name).zip(errors).collect()
    }
}

/// The form the drive runs.
pub const SECTIONS_F32: &str = "sections, f32 (the drive)";

/// The three filters.
pub fn filters() -> [Box<dyn ComparedFilter + Send>; 3] {
    [
        Box::new(Filter { name: "LPF", sections: LPF_AS_PRINTED, direct: direct::LPF }),
        Box::new(Filter { name: "BPF", sections: BPF, direct: direct::BPF }),
        Box::new(Filter { name: "PP", sections: PP, direct: direct::PP }),
    ]
}
