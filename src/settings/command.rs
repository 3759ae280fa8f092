//! The settings for the handling of commands.

use super::Commander;
use super::own::settings;

settings! { [command]
    101: number("s"), "command.timeout_s", timeout_s: f32 = 0.0, "time without a valid line after which the drive stops; 0: never".from_to(0.0, 3600.0).guarded(Guard::Lower);
    // A small spindle coasts for half a minute.
    132: number("s"), "stop.coasts_s", coasts_s: f32 = 60.0, "longest time in which the shaft coasts to rest".from_to(0.0, 3600.0).guarded(Guard::Raise);
    102: word(), "wiring_checked", wiring_checked: bool = false, "whether a start has checked the wiring since the defaults were set".guarded(Guard::Keep);
    103: word(), "console.echo", echo: bool = false, "whether the console sends typed characters back";
    104: word(), "bus.commands", commander: Commander = Commander::Console, "who starts the drive and gives it references; anybody may stop it";
}
