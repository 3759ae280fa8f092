//! Drive and motor as two functional mock-up units (FMUs) of the Functional Mock-up Interface 2.0 for co-simulation. Both are this one
//! library, and the identifier of the instance tells which of them it is.
//!
//! | module | contents |
//! |---|---|
//! | [`model`] | the form of a model, and its variables |
//! | [`drive`], [`motor`] | the two models, one control period at a time |
//! | [`mod@unit`] | an FMU in use: its model, its settings, its inputs and its time |
//! | [`interface`] | the functions of the standard |

pub mod drive;
pub mod interface;
pub mod model;
pub mod motor;
pub mod unit;
