"""The wheel beside the program of the same sources, which HIL_SIM names: `cargo xtask python` runs this."""

import json
import os
import pathlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import induction_drive as drive
import nbformat
import numpy as np
import pandas
import pytest
from nbclient import NotebookClient

MOTORS = ["dissertation", "krause-3hp", "motulator-2kw2"]
NOTEBOOKS = sorted((pathlib.Path(__file__).parent.parent / "notebooks").glob("*.ipynb"))

# A point a sample.
SCENARIO = """
samples = 1
figure = "run"
columns = ["torque_nm", "torque_current_a", "direct_current_a", "current_a", "flux_wb", "angle_error_deg"]
judge = []
[[part]]
seconds = 0.5
torque_current_a = 1
[[part]]
seconds = 0.5
torque_current_a = -1.5
"""


def program(*arguments):
    command = [os.environ["HIL_SIM"], "run", *arguments, "--json", "--quiet"]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def bits(values):
    return np.asarray(values, dtype=float).view(np.uint64)


@pytest.mark.parametrize("seed", [1, 7])
def test_torque_steps_are_those_of_the_program(seed):
    ours, theirs = drive.run("torque-steps", seed=seed), program("torque-steps", "--seed", str(seed))
    assert len(ours["steps"]) == 5 and ours["metrics"]["lost"] == 0
    # The shortest text of a number has its bits.
    assert json.dumps(ours) == json.dumps(theirs)


def test_a_nameplate_is_a_motor(tmp_path):
    file = tmp_path / "motor.toml"
    file.write_text(drive.motor_file("750 W, 400 V, 1.86 A, 50 Hz, 1400 rpm"))
    run = drive.run("torque-steps", drive.Config(motor=str(file)))
    assert run["metrics"]["angle_error_max_deg"] < 8 and "estimated" in " ".join(run["remarks"])
    with pytest.raises(ValueError, match="nameplate.power_w = 7500"):
        drive.motor_file("7500 W, 400 V, 1.86 A, 50 Hz, 1400 rpm")


@pytest.mark.parametrize("plant", ["a", "r"])
def test_a_rig_has_the_bits_of_a_scenario_of_the_program(tmp_path, plant):
    file = tmp_path / "run.toml"
    file.write_text(SCENARIO)
    learn = {"prepare.learn": True}
    series = program(str(file), "--seed", "3", "--plant", plant, "--set", "prepare.learn=yes")["series"]
    rig = drive.Rig(drive.Config(plant=plant, set=learn), seed=3)
    rig.start("torque")
    runs = []
    for current_a in [1, -1.5]:
        rig.command("torque", current_a)
        runs.append(rig.run(0.5))
    seen = {name: np.concatenate([run[name] for run in runs]) for name in runs[0]}
    assert rig.fault is None and len(seen["time_s"]) == 6000
    assert abs(seen["torque_nm"][5000:].mean()) > 0.3
    columns = SCENARIO.split('"')[3:15:2]
    assert len(series) == len(columns) == 6
    for name, curve in zip(columns, series.values()):
        assert np.array_equal(bits(seen["time_s"] - seen["time_s"][0]), bits(curve["x"])), name
        assert np.array_equal(bits(seen[name]), bits(curve["y"])), name


@pytest.mark.parametrize(
    "wrong, words",
    [
        (lambda: drive.Config(set={"motor.r_s": -1}), "motor.r_s = -1: out of range; allowed: 0. ... to 1000 ohm"),
        (lambda: drive.Config(set={"motor.r_q": 1}), "there is no key `motor.r_q`; did you mean `motor.r_r`"),
        (lambda: drive.Config(set={"angle_source": "star"}), "angle_source = star"),
        (lambda: drive.Config(motor="krause-3pH"), "did you mean `krause-3hp`"),
        (lambda: drive.Config(plant="q"), "plant = q"),
        (lambda: drive.run("torque-step"), "did you mean `torque-steps`"),
        (lambda: drive.run("saliency", drive.Config(set={"speed.limit_rpm": 100})), "saliency does not use `speed.limit_rpm`"),
        (lambda: drive.run("torque-steps", seconds=0), "seconds = 0: out of range; allowed: 0.001 to 3600 s"),
        (lambda: drive.Rig(drive.Config()).command("torqe", 1), "unknown command `torqe`; did you mean `torque`"),
        (lambda: drive.Rig(drive.Config()).start("torqe"), "unknown command `start torqe`"),
        (lambda: drive.Rig(drive.Config()).set_load("fre", 1), "unknown load `fre`; did you mean `free`"),
        (lambda: drive.Rig(drive.Config()).run(float("inf")), "seconds = inf: allowed is 0 to 600 s"),
        (lambda: drive.Rig(drive.Config()).run(float("nan")), "seconds = NaN"),
        (lambda: drive.Plant(drive.Config()).run(np.zeros(1, complex), 1), "step_s = 1: allowed is 0.0000001 to 0.001 s"),
        (lambda: drive.Plant(drive.Config()).set_load("free", float("inf")), "allowed"),
    ],
)
def test_what_is_wrong_is_named_with_its_range(wrong, words):
    with pytest.raises(ValueError) as error:
        wrong()
    assert all(part in str(error.value) for part in words.split(" ... "))


def test_settings_read_as_they_were_set():
    config = drive.Config(motor="krause-3hp", set={"motor.r_s": 0.45, "prepare.learn": False})
    settings = config.settings()
    assert settings["motor.r_s"] == 0.45 and settings["drive.motor.r_s"] == 0.45
    assert settings["prepare.learn"] is False and settings["plant"] == "a"
    assert "motor.r_s=0.45" in repr(config)


def test_a_refusal_of_the_drive_and_a_fault_are_told():
    control = drive.Drive(drive.Config())
    with pytest.raises(RuntimeError, match="refuses relock: not possible while the drive is off"):
        control.command("relock")
    control.command("start torque")
    assert control.command("torque", 100) < 10
    for _ in range(10):
        control.step(0, 0, 311)
    assert control.state == "calibrating" and control.fault is None
    assert control.step(1000, -500, 311) is None
    assert control.fault.startswith("fault ") and "current" in control.fault


def test_drive_and_plant_close_the_loop_in_python():
    """The torque of the encoder's field orientation is that of its currents: 3/2 P L_m/L_r psi i_q."""
    config = drive.Config(set={"angle_source": "encoder", "inverter.dead_time_s": 0})
    control, motor = drive.Drive(config), drive.Plant(config)
    motor.set_load("locked")
    control.command("start torque")
    phase_a_b, duties, torque = (0.0, 0.0), None, []
    to_vector = np.exp(2j * np.pi / 3 * np.arange(3)) * 2 / 3
    for period in range(18_000):
        if period == 6000:
            control.command("torque", 1.5)
        following = control.step(*phase_a_b, 311)
        voltage = 311 * np.dot(duties, to_vector) if duties else 0j
        seen = motor.run(np.array([voltage]), drive.PERIOD_S)
        current = seen["current"][-1]
        phase_a_b = current.real, (np.sqrt(3) * current.imag - current.real) / 2
        torque.append(seen["torque_nm"][-1])
        duties = following
    assert control.state == "regulating torque"
    telemetry, flux = control.telemetry(), abs(seen["flux"][-1])
    settings = config.settings()
    factor = 1.5 * settings["motor.pole_pairs"] * settings["motor.l_m"] / (settings["motor.l_m"] + settings["motor.l_lr"])
    assert telemetry["torque_current_a"] == pytest.approx(1.5, abs=0.03)
    assert np.mean(torque[-600:]) == pytest.approx(factor * flux * 1.5, rel=0.03)


def test_a_commissioning_finds_the_motor():
    config = drive.Config(motor="krause-3hp")
    found = drive.commission(config, seed=2)
    for name in ["r_s", "r_r", "l_m"]:
        assert found[f"drive.motor.{name}"] == pytest.approx(config.settings()[f"motor.{name}"], rel=0.03), name
    drive.Config(motor="krause-3hp", set=found)


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_the_notebook_runs(file, tmp_path):
    notebook = nbformat.read(file, as_version=4)
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    text = "".join(output.get("text", "") for output in outputs)
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    print(text)
    if file.stem == "my_motor":
        assert len(pictures) == 1 and "mean torque" in text
        return
    beside_motulator = sys.version_info >= (3, 12)
    assert len(pictures) == 3 + beside_motulator and ("times motulator's speed" in text) == beside_motulator


def test_editors_know_every_name(tmp_path):
    """The stubs describe the module as it is."""
    # The library inside of the package has no stubs of its own.
    allowed = tmp_path / "allowed"
    allowed.write_text("induction_drive.induction_drive\n")
    stubs = [sys.executable, "-m", "mypy.stubtest", "induction_drive", "--ignore-disjoint-bases", "--allowlist", allowed]
    checked = subprocess.run(stubs, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_the_readme_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (pathlib.Path(__file__).parent.parent / "README.md").read_text()
    examples = [part.split("```")[0] for part in text.split("```python\n")[1:]]
    assert len(examples) == 2
    for example in examples:
        exec(example, {})


def test_a_run_is_a_table_with_units():
    """The recipe of docs/tools.md."""
    rig = drive.Rig(drive.Config())
    rig.start("torque")
    rig.command("torque", 2.0)
    table = pandas.DataFrame(rig.run(0.5)).set_index("time_s")
    units = {name: name.rsplit("_", 1)[1] for name in table if "_" in name}
    assert units["torque_nm"] == "nm" and units["current_a"] == "a"
    assert table["torque_nm"].tail(2400).mean() == pytest.approx(0.64, abs=0.01)


def test_motors_run_on_all_cores():
    """The recipe of docs/tools.md: a run does not hold the interpreter."""
    def torque(motor):
        return drive.run("torque-steps", drive.Config(motor=motor))["metrics"]["angle_error_max_deg"]

    with ThreadPoolExecutor() as cores:
        errors = dict(zip(MOTORS, cores.map(torque, MOTORS)))
    assert all(error < 8 for error in errors.values()), errors
