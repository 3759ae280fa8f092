//! Plant models.
