//! Numbers and roundings that the rows of the settings share with the rules.

/// Rules end this far within the limits of the power stage and of other settings, since they round to four digits.
pub(super) const WITHIN: f32 = 0.998;
/// Share of the sensors' range that trips: noise and drift leave the reading of a larger current at the end of the range. And trip in
/// rated currents: it leaves the current limit with high flux what that needs. A trip has one rule for any flux: the bench steps
/// of a board hold for it, and commissioning changes the flux.
pub(super) const TRIP_OF_RANGE: f32 = 0.9614;
pub(super) const TRIP_OF_RATED: f32 = 2.2;
/// Largest dc link without generating torque, in relation to the voltage that trips.
pub(super) const HIGH_OF_TRIP: f32 = 0.975;
/// Least dc link without motoring torque, in relation to the voltage that trips.
pub(super) const LOW_OF_TRIP: f32 = 1.15;
/// `braking.high_v` and `.low_v` stay this far from their neighbours.
pub(super) const MARGIN: f32 = 0.05;

/// The value that was set or, if none was, that of the rule, rounded to four digits.
pub(super) fn or_rule<S>(s: &S, set: Option<f32>, rule: fn(&S) -> f32) -> f32 {
    set.unwrap_or_else(|| {
        let value = f64::from(rule(s));
        // Zero has no first digit.
        let last = libm::pow(10.0, libm::floor(libm::log10(value.abs().max(1e-30))) - 3.0);
        (libm::round(value / last) * last) as f32
    })
}

/// The range of a value that has either sign, but is not zero.
pub(super) fn either_sign(value: f32, min: f32, max: f32) -> (f32, f32) {
    if value < 0.0 { (-max, -min) } else { (min, max) }
}
