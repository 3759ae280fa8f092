"""An induction motor that holds torque at zero speed without a sensor: the drive of the firmware on a simulated motor."""

from collections.abc import Mapping
from os import PathLike
from typing import Any, Literal, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "commission",
    "Config",
    "Drive",
    "motor_file",
    "Plant",
    "Rig",
    "run",
    "PERIOD_S",
]

PERIOD_S: float
"""Control period, s."""

_Value = bool | float | int | str
_Load = Literal["free", "locked", "speed"]

@final
class Config:
    """A motor with inverter, sensors and load, and its drive, as the options of `cargo sim` describe them."""

    def __new__(
        cls,
        motor: str | None = None,
        plant: str | None = None,
        set: Mapping[str, _Value] | None = None,
        file: str | PathLike[str] | None = None,
    ) -> Config: ...
    def settings(self) -> dict[str, bool | float | str | None]:
        """Every key with its value; None where it follows from others."""

@final
class Drive:
    """The control of the firmware alone, between measured values and duties."""

    def __new__(cls, config: Config) -> Drive: ...
    def step(
        self, current_a: float, current_b: float, dc_link_v: float, encoder: int = 0
    ) -> list[float] | None:
        """One control period: the duties of the three legs, 0 to 1; None if all switches are off at once."""
    def command(self, name: str, value: float = 0.0) -> float | None:
        """Gives a command by its name at the console; returns the value in force if it was limited."""
    def telemetry(self) -> dict[str, float]:
        """Estimates and references of the last period with the outputs on."""
    @property
    def state(self) -> str: ...
    @property
    def fault(self) -> str | None: ...

@final
class Plant:
    """The motor of a configuration with its shaft, between voltages and currents."""

    def __new__(cls, config: Config) -> Plant: ...
    def run(self, voltages: NDArray[np.complex128], step_s: float) -> dict[str, NDArray[Any]]:
        """Applies space vectors of the voltage, V, each for `step_s` seconds."""
    def set_load(self, mode: _Load, value: float = 0.0) -> None:
        """Couples a load: free against a torque, Nm, locked, or held at a speed, rpm."""

@final
class Rig:
    """The drive on inverter, motor, load and sensors of a configuration."""

    def __new__(cls, config: Config, seed: int = 1) -> Rig: ...
    def start(self, mode: Literal["torque", "speed", "position", "vf"]) -> None:
        """Starts and runs until the drive regulates."""
    def run(self, seconds: float) -> dict[str, NDArray[np.float64]]:
        """Runs, and returns arrays with a value for each control period; names end with the unit."""
    def set_load(self, mode: _Load, value: float = 0.0) -> None:
        """Couples a load: free against a torque, Nm, locked, or held at a speed, rpm."""
    def command(self, name: str, value: float = 0.0) -> float | None:
        """Gives a command by its name at the console; returns the value in force if it was limited."""
    def telemetry(self) -> dict[str, float]:
        """Estimates and references of the last period with the outputs on."""
    @property
    def state(self) -> str: ...
    @property
    def fault(self) -> str | None: ...

def run(
    experiment: str,
    config: Config | None = None,
    *,
    seed: int = 1,
    seconds: float | None = None,
    input: str | PathLike[str] | None = None,
) -> dict[str, Any]:
    """Runs an experiment, a group of them or the TOML file of a scenario."""

def motor_file(nameplate: str) -> str:
    """Text of a motor file, made from a nameplate such as `750 W, 400 V, 1.86 A, 50 Hz, 1400 rpm`."""

def commission(config: Config, seed: int = 1) -> dict[str, float]:
    """Commissions the motor at rest; returns the settings that follow, for `Config(set=...)`."""
