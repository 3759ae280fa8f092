//! A drive that is given recorded samples and requests, and hashes of its outputs and estimates.

use std::fmt;

use drive_commission::{Collector, Commissioning, Next, Step};
use drive_core::{Command, Compare, Drive, FrontEndState, Mode, Output, Sample, Stop, Telemetry};
use induction_drive::console::grammar::{self, Request};
use induction_drive::desk::order::Order;
use induction_drive::settings::FirmwareSettings;

use super::scenes::Scene;

/// Periods per hash, so that a difference is located.
pub const BLOCK: usize = 6000;
/// Periods between two polls of the commissioning.
const POLL: usize = 6;

/// FNV-1a.
#[derive(Clone, Copy)]
pub struct Fnv(pub u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    pub fn push(&mut self, bytes: &[u8]) {
        let next = |hash: u64, &byte: &u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        self.0 = bytes.iter().fold(self.0, next);
    }

    fn numbers(&mut self, numbers: &[f32]) {
        numbers.iter().for_each(|number| self.push(&number.to_bits().to_le_bytes()));
    }

    pub fn compare(&mut self, compare: &Compare) {
        [compare.a, compare.b, compare.c].iter().for_each(|count| self.push(&count.to_le_bytes()));
        self.push(&[u8::from(compare.enabled)]);
    }
}

/// Hashes of a block: of the outputs, and of the drive's estimates.
#[derive(Clone, Copy, Default)]
pub struct Hashes {
    outputs: Fnv,
    beliefs: Fnv,
}

impl fmt::Display for Hashes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x} {:016x}", self.outputs.0, self.beliefs.0)
    }
}

impl Hashes {
    fn push(&mut self, compare: &Compare, output: &Output, drive: &Drive) {
        self.outputs.compare(compare);
        self.outputs.push(&[u8::from(output.relay)]);
        self.outputs.numbers(&[output.chopper]);
        let t = drive.telemetry();
        let Telemetry { reference, current, voltage, realised, .. } = t;
        let b = &mut self.beliefs;
        b.push(drive.state().to_string().as_bytes());
        b.push(&t.phi.to_bits().to_le_bytes());
        b.numbers(&[t.flux_freq, t.rotor_freq, reference.d, reference.q, current.d, current.q]);
        b.numbers(&[voltage.d, voltage.q, realised.alpha, realised.beta, t.dc_link, t.turns]);
        b.numbers(&[
            t.saliency,
            t.carrier_squared,
            t.carrier_share,
            t.saliency_loss,
            t.inverter_drop,
        ]);
        let room = drive.torque_limits();
        b.numbers(&[room.i_q.0, room.i_q.1, room.thermal_reduction_a, room.voltage]);
        b.push(drive.limiting().to_string().as_bytes());
        b.numbers(&[drive.stator_resistance().unwrap_or(f32::NAN)]);
    }
}

/// Requests and commissioning around a drive; a recording and its replay share them.
pub struct Player {
    settings: FirmwareSettings,
    commissioning: Option<Commissioning>,
    sums: Collector,
    periods: usize,
    /// Whether the commissioning has ended.
    pub has_commissioned: bool,
}

impl Player {
    pub fn new(settings: &FirmwareSettings) -> Self {
        Self {
            settings: *settings,
            commissioning: None,
            sums: Collector::default(),
            periods: 0,
            has_commissioned: false,
        }
    }

    /// Gives the drive a request as it is typed at the console, or one of the commands that cannot be typed.
    pub fn order(&mut self, drive: &mut Drive, line: &str) {
        let mut words = line.split(' ');
        let word = words.next().unwrap();
        let mut number = || words.next().unwrap().parse().unwrap();
        let command = match word {
            "check" => Command::CheckWiring,
            "press" => Command::Press(number(), number()),
            "origin" => Command::Home(number()),
            "magnetising" => Command::Magnetising(number()),
            "commission" => {
                let mut commissioning = Commissioning::new(&self.settings.drive);
                commissioning.start(Step::Nameplate, Step::CurrentLoop);
                self.commissioning = Some(commissioning);
                return;
            }
            "accept" => {
                let commissioning = self.commissioning.take().unwrap();
                self.settings.drive = commissioning.settings(&self.settings.drive);
                Command::Configure(self.settings.drive.build().unwrap())
            }
            _ => match grammar::parse(line).unwrap() {
                Request::Order(Order::Start(mode)) => Command::Start(mode),
                Request::Order(Order::Learn { .. }) => Command::Start(Mode::Learning),
                Request::Order(Order::Stop(stop)) => Command::Stop(stop),
                Request::Order(Order::Clear) => Command::Clear,
                Request::Order(Order::Relock) => Command::Relock,
                Request::Order(Order::Torque(i_q)) => Command::Torque(i_q),
                Request::Order(Order::Speed(rpm)) => Command::Speed(rpm),
                Request::Order(Order::Jog(rpm)) => Command::Jog(rpm),
                Request::Order(Order::Position(turns)) => Command::Position(turns),
                Request::Set(values) => {
                    values.iter().for_each(|(key, value)| key.set(&mut self.settings, *value));
                    // With the dead time that the board's timer can have.
                    Command::Configure(self.settings.build().unwrap())
                }
                other => panic!("{other:?} is no order to the drive"),
            },
        };
        let taken = drive.command(&command);
        assert!(taken.is_ok(), "{line}: {taken:?}");
    }

    /// The rest of a control period, after the outputs are set.
    pub fn end_period(&mut self, drive: &mut Drive) {
        let seen = drive.telemetry();
        if drive.is_testing() {
            self.sums.push(seen.measured, seen.realised, seen.dc_link);
        }
        if drive.state().regulates() {
            self.sums.push_motion(seen.reference.q, seen.rotor_freq);
        }
        self.periods += 1;
        if !self.periods.is_multiple_of(POLL) {
            return;
        }
        let Some(commissioning) = &mut self.commissioning else { return };
        let command = match commissioning.poll(&drive.test_report(), &mut self.sums) {
            Next::Excite(excitation) => Command::Test(excitation),
            Next::Stop => Command::Stop(Stop::Coast),
            Next::Start => Command::Start(Mode::Torque),
            Next::Torque(i_q) => Command::Torque(i_q),
            Next::Design => return commissioning.design(),
            Next::Report(report) => {
                let refused = report.refusal;
                return assert!(refused.is_none(), "{report:?}");
            }
            Next::Wait => return,
            Next::Done => return self.has_commissioned = true,
        };
        drive.command(&command).unwrap();
    }
}

/// Gives a drive these samples and requests, and passes the outputs of each period on; returns the drive. The requests to the bench came
/// before the period of their number, those to the board after it.
pub fn play(
    mut drive: Drive,
    settings: &FirmwareSettings,
    samples: &[Sample],
    orders: &str,
    after: usize,
    mut take: impl FnMut(usize, &Compare, &Output, &Drive),
) -> Drive {
    let (mut front_end, mut player) = (FrontEndState::default(), Player::new(settings));
    let mut orders = orders.lines().map(|line| line.split_once(' ').unwrap()).peekable();
    for (n, sample) in samples.iter().enumerate() {
        while let Some((_, line)) =
            orders.next_if(|(number, _)| number.parse() == Ok(n.wrapping_sub(after)))
        {
            player.order(&mut drive, line);
        }
        let mut last = None;
        let (compare, output) =
            drive.period(&mut front_end, sample, &mut |compare| last = Some(compare));
        assert_eq!(last, Some(compare), "{n}");
        take(n, &compare, &output, &drive);
        player.end_period(&mut drive);
    }
    assert_eq!(orders.next(), None, "an order that was not reached");
    drive
}

/// Replays a scene; returns the drive, and the hashes of each block.
pub fn replay(scene: &Scene, samples: &[Sample], orders: &str) -> (Drive, Vec<Hashes>) {
    let mut hashes = Vec::new();
    let take = |n: usize, compare: &Compare, output: &Output, drive: &Drive| {
        if n.is_multiple_of(BLOCK) {
            hashes.push(Hashes::default());
        }
        hashes.last_mut().unwrap().push(compare, output, drive);
    };
    let settings = scene.firmware_settings();
    let drive = play(scene.drive(), &settings, samples, orders, 0, take);
    (drive, hashes)
}
