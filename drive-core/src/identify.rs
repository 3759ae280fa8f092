//! Identification in the control step: learning with locked shaft.

pub(crate) mod learning;
