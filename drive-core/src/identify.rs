//! Identification in the control step: saliency self-commissioning with a locked shaft.

pub(crate) mod learning;
