pub const EXPERIMENT: super::Experiment = super::Experiment {
    name: "identify-trace",
    stands_for: "a recorded trace",
    about: "Stator resistance, rotor time constant and inductances from a recorded trace.",
    uses: &[],
    not: &[],
    run: |_| Err(crate::error::Error::Refused("identify-trace is a command of its own".into())),
};
pub fn identify(
    _: &std::path::Path,
    _: &[String],
    _: &crate::config::Config,
) -> Result<crate::outcome::Outcome, crate::error::Error> {
    todo!()
}
