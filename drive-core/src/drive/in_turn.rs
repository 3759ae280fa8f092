//! What is done once a carrier period, in turn: in each of its ten samples something else, so that no step
//! takes much longer than another.

use super::ControlState;
use crate::carrier::synchronous::REFERENCE_AT;
use crate::current::sensing::Measured;
use crate::drive::coefficients::Coefficients;
use crate::fault::Fault;
use crate::io::Sample;
use crate::math::angle::UnitVector;
use crate::math::frames::Dq;
use crate::protect::plausibility::RotorFlux;
use crate::settings::AngleSource;

/// What it sees of the step, beside the state.
pub(super) struct Seen<'a> {
    pub sample: &'a Sample,
    pub measured: &'a Measured,
    /// Current that makes flux and slip, A.
    pub flux_current: Dq,
    /// Filtered reference of the quadrature current, A.
    pub i_q: f32,
    /// Voltage without the carrier, V.
    pub voltage: Dq,
    /// The injection axis where it was when the carrier current flowed that is sampled now.
    pub carrier_axis: UnitVector,
    /// The flux when the filtered current flowed.
    pub flux_axis: UnitVector,
    /// How fast it turns, turns per period.
    pub flux_freq: f32,
    /// Electrical speed of the rotor, turns per period.
    pub rotor_freq: f32,
    /// Whether the flux is held still.
    pub held: bool,
    /// Whether the drive learns: then nothing is tracked, and what to compare with is not known yet.
    pub learning: bool,
}

impl Coefficients {
    /// What is due in sample `index` of the carrier period, which counts with or without a carrier.
    pub(super) fn in_turn(
        &self,
        s: &mut ControlState,
        index: usize,
        step: &Seen,
    ) -> Result<(), Fault> {
        match index {
            0 => {
                self.estimator.update_saliency(&mut s.estimator);
                self.indirect.magnetise(&mut s.indirect, step.flux_current.d);
                if self.source == AngleSource::Injection {
                    s.seen.rotor_count = s.count_by_flux();
                }
                self.listen(s, 0, step.sample)
            }
            1 => {
                let acceleration = self.freq_per_speed * s.motion.acceleration;
                self.estimator.update_correction(&mut s.estimator, acceleration);
                s.prediction.latch_voltage();
                self.listen(s, 1, step.sample)
            }
            2 => {
                self.expect(s, step);
                self.listen(s, 2, step.sample)
            }
            3 => {
                self.check_carrier_headroom(s, step)?;
                self.prediction.judge(&mut s.prediction, step.measured.current)
            }
            4 => self.check_lock(s, step),
            REFERENCE_AT => {
                s.estimator.synchronous.average_reference(step.i_q);
                self.turn(&mut s.axes, step.flux_freq, s.references.injection_axis);
                Ok(())
            }
            6 => {
                s.prediction.latch_voltage();
                self.check_both_channels(s, step)
            }
            7 => {
                self.expect(s, step);
                self.listen(s, 3, step.sample)
            }
            8 => {
                if step.rotor_freq.abs() > self.protection.rotor_freq {
                    return Err(Fault::OverSpeed);
                }
                self.prediction.judge(&mut s.prediction, step.measured.current)?;
                self.listen(s, 4, step.sample)
            }
            _ => {
                s.estimator.synchronous.average();
                self.listen(s, 5, step.sample)
            }
        }
    }

    /// For the noise of the sensors.
    fn listen(&self, s: &mut ControlState, look: usize, sample: &Sample) -> Result<(), Fault> {
        match &self.noise_watch {
            Some(watch) => watch.step(&mut s.noise, look, sample),
            None => Ok(()),
        }
    }

    /// What the current will be compared with.
    fn expect(&self, s: &mut ControlState, step: &Seen) {
        let flux = RotorFlux {
            magnetising: s.indirect.magnetising,
            rotor_freq: step.rotor_freq,
            axis: step.flux_axis,
            flux_freq: step.flux_freq,
        };
        self.prediction.expect(&mut s.prediction, &flux);
    }

    fn check_lock(&self, s: &mut ControlState, step: &Seen) -> Result<(), Fault> {
        match &self.lock_monitor {
            Some(monitor)
                if self.inject && s.carrier.is_settled() && (step.held || !step.learning) =>
            {
                let seen = s.estimator.synchronous.saliency;
                monitor.step(&mut s.lock, &seen, s.carrier.per_share_squared, step.held)
            }
            _ => Ok(()),
        }
    }

    fn check_both_channels(&self, s: &mut ControlState, step: &Seen) -> Result<(), Fault> {
        if !self.inject {
            return Ok(());
        }
        let amplitude = s.carrier.share * self.injection.current_amplitude;
        let current = s.estimator.synchronous.carrier_current();
        s.carrier_watch.step(current, step.carrier_axis, amplitude)
    }

    /// Beside the fundamental.
    fn check_carrier_headroom(&self, s: &mut ControlState, step: &Seen) -> Result<(), Fault> {
        if !self.inject {
            return Ok(());
        }
        let largest = self.modulator.circle(step.measured.dc_link);
        let fit = s.carrier.fit(&self.injection, step.voltage, largest);
        fit.map_err(|_| Fault::CarrierNoRoom)
    }
}
