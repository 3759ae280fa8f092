//! The filters, each in the forms under comparison.

use drive_core::filter::{BPF, LPF_AS_PRINTED, PP, Sos, SosState};

use super::direct::{self, Form};
use crate::prelude::*;

/// A filter whose forms are compared: responses, and the error of each form.
pub struct ComparedFilter {
    /// Its name in the source.
    pub name: &'static str,
    /// Numerator and denominator from Tables 7 and 8.
    pub printed: [Vec<f64>; 2],
    response: fn(f64) -> Complex64,
    /// Makes a filter of sections at rest, as the drive runs it.
    at_rest: fn() -> Box<dyn FnMut(f32) -> f32>,
}

impl ComparedFilter {
    /// Frequency response of the sections in the drive.
    pub fn sections(&self, omega_t: f64) -> Complex64 {
        (self.response)(omega_t)
    }

    /// Frequency response from Tables 7 and 8.
    pub fn direct(&self, omega_t: f64) -> Complex64 {
        direct::response(&self.printed, omega_t)
    }

    /// Measures errors against `f64`, A: for each form its name, its name in the metrics and statistics.
    pub fn errors(&self, input: &mut dyn FnMut() -> f64, samples: u64) -> Vec<FormErrors> {
        let mut forms: Vec<Form> =
            vec![("sections, f32 (the drive)", "sections", (self.at_rest)())];
        forms.extend(direct::f32_forms(&self.printed));
        let mut reference = direct::reference(&self.printed);
        let mut errors = vec![Stats::default(); forms.len()];
        for _ in 0..samples {
            // All forms get the same f32 input.
            let x = input() as f32;
            let exact = reference(f64::from(x));
            for ((.., form), error) in forms.iter_mut().zip(&mut errors) {
                error.push(f64::from(form(x)) - exact);
            }
        }
        forms.iter().zip(errors).map(|((name, key, _), error)| (*name, *key, error)).collect()
    }
}

/// A form, its name in the metrics, and its errors.
pub type FormErrors = (&'static str, &'static str, Stats);

fn running<const SECTIONS: usize>(sections: Sos<SECTIONS>) -> Box<dyn FnMut(f32) -> f32> {
    let mut state = SosState::default();
    Box::new(move |x| sections.step(&mut state, x))
}

/// The three filters.
#[rustfmt::skip] // a filter a line
pub fn filters() -> [ComparedFilter; 3] {
    [
        ComparedFilter { name: "LPF", printed: direct::printed("Table 7", "LPF"), response: |w| LPF_AS_PRINTED.response(w), at_rest: || running(LPF_AS_PRINTED) },
        ComparedFilter { name: "BPF", printed: direct::printed("Table 8", "BPF"), response: |w| BPF.response(w), at_rest: || running(BPF) },
        ComparedFilter { name: "PP", printed: direct::printed("Table 8", "PP"), response: |w| PP.response(w), at_rest: || running(PP) },
    ]
}
