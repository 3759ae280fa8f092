//! The earlier drive as the battery runs it.

use drive_before::sensing::Line;
use drive_before::{Command, Compare, Drive, Hardware, Mode, Sample, Settings, State, Taken};
use drive_core::{Compare as CompareNow, Sample as SampleNow};
use hil_sim::Config;
use hil_sim::experiments::battery::{Condition, DriveUnderTest, Purpose};

/// The earlier drive.
#[derive(Clone)]
pub struct Before(Drive);

impl Before {
    /// With its own defaults. It knows the scales of the converters and the magnetising current of the configuration,
    /// which are those of the plant.
    pub fn new(config: &Config) -> anyhow::Result<Self> {
        let mut settings = Settings::default();
        let (scales, from) = (&mut settings.scales, &config.drive.scales);
        let line = |line: drive_core::settings::Line| Line { gain: line.gain, offset: line.offset };
        scales.current_a = line(from.current_a);
        scales.current_b = line(from.current_b);
        scales.dc_link = line(from.dc_link);
        scales.full_scale = from.full_scale;
        scales.current_delay_s = from.current_delay_s;
        settings.sequence.i_d = config.drive.i_d();
        let coefficients = settings.build().map_err(|e| anyhow::anyhow!("{e}"))?;
        Ok(Self(Drive::new(coefficients)))
    }

    fn command(&mut self, command: Command<'_>) -> Result<(), String> {
        self.0.command(command).map(|_| ()).map_err(|refused| refused.to_string())
    }
}

/// The events of the hardware as the earlier drive names them.
fn hardware(now: drive_core::Hardware) -> Hardware {
    use drive_core::Hardware as Now;
    let events = [
        (Now::BREAK, Hardware::BREAK),
        (Now::ANALOG_WATCHDOG, Hardware::ANALOG_WATCHDOG),
        (Now::DEADLINE_MISS, Hardware::DEADLINE_MISS),
        (Now::CONVERTER_OVERRUN, Hardware::CONVERTER_OVERRUN),
    ];
    let present = events.into_iter().filter(|(event, _)| now.contains(*event));
    present.fold(Hardware::NONE, |all, (_, event)| all.and(event))
}

impl DriveUnderTest for Before {
    fn step(&mut self, sample: &SampleNow) -> CompareNow {
        let Compare { a, b, c, enabled } = self.0.step(&Sample {
            current_a: sample.current_a,
            current_b: sample.current_b,
            dc_link: sample.dc_link,
            heat_sink: sample.heat_sink,
            encoder: sample.encoder,
            hardware: hardware(sample.hardware),
        });
        CompareNow { a, b, c, enabled }
    }

    fn start(&mut self, purpose: Purpose) -> Result<(), String> {
        self.command(Command::Start(match purpose {
            Purpose::Torque => Mode::Torque,
            Purpose::Speed => Mode::Speed,
            Purpose::Learning => Mode::Learning,
        }))
    }

    fn torque(&mut self, i_q: f32) -> Result<f32, String> {
        match self.0.command(Command::Torque(i_q)) {
            Ok(Taken::Limited(taken)) => Ok(taken),
            Ok(_) => Ok(i_q),
            Err(refused) => Err(refused.to_string()),
        }
    }

    fn speed(&mut self, rpm: f32) -> Result<(), String> {
        self.command(Command::Speed(rpm))
    }

    fn condition(&self) -> Condition {
        match self.0.state() {
            State::Off => Condition::Off,
            State::Fault(fault) => Condition::Fault(fault.code()),
            state if state.regulates() => Condition::Regulating,
            _ => Condition::Busy,
        }
    }

    fn flux_turns(&self) -> f64 {
        self.0.telemetry().phi.to_turns().into()
    }
}
