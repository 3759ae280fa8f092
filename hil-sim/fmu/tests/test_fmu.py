"""Drive and motor in FMPy and libcosim, masters that others have written."""

import os
import time
from pathlib import Path
from xml.etree import ElementTree as xml

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.validation import validate_fmu
from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver

FOLDER = Path(os.environ["FMUS"])
PERIOD_S = 1 / 6000
NAMES = ["induction-drive", "induction-motor"]
SENSORS = ["sensor_a", "sensor_b", "sensor_dc_link", "heat_sink", "encoder"]
DUTIES = ["duty_a", "duty_b", "duty_c"]


class Instance:
    """An FMU with its variables by name."""

    def __init__(self, name, **parameters):
        file = FOLDER / f"{name}.fmu"
        self.description = read_model_description(file)
        self.references = {one.name: one.valueReference for one in self.description.modelVariables}
        self.messages = []
        self.fmu = FMU2Slave(guid=self.description.guid, unzipDirectory=extract(file), instanceName=name,
                             modelIdentifier=self.description.coSimulation.modelIdentifier)
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(lambda *words: self.messages.append(words[-1].decode()))
        self.fmu.instantiate(callbacks=callbacks)
        self.fmu.setupExperiment(startTime=0.0)
        self.set(**parameters)

    def begin(self):
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def set(self, **values):
        self.fmu.setReal([self.references[name] for name in values], list(values.values()))

    def get(self, *names):
        return self.fmu.getReal([self.references[name] for name in names])


@pytest.mark.parametrize("name", NAMES)
def test_the_file_is_valid(name):
    assert validate_fmu(FOLDER / f"{name}.fmu") == []


def test_the_loop_closes_in_less_than_two_seconds_a_second():
    drive, motor = (Instance(name).begin() for name in NAMES)
    send = [[motor.references[name] for name in SENSORS], [drive.references[name] for name in DUTIES]]
    take = [[drive.references[name] for name in ("i_a", "i_b", "dc_link", "heat_sink", "encoder")],
            [motor.references[name] for name in DUTIES]]
    on = [[drive.references["enabled"]], [motor.references["enabled"]]]
    drive.fmu.setInteger([drive.references["mode"]], [1])
    drive.set(reference=2.0)
    torques, began = [], time.perf_counter()
    for period in range(4 * 6000):
        sensors, duties, enabled = motor.fmu.getReal(send[0]), drive.fmu.getReal(send[1]), drive.fmu.getInteger(on[0])
        drive.fmu.setReal(take[0], sensors)
        motor.fmu.setReal(take[1], duties)
        motor.fmu.setInteger(on[1], enabled)
        for one in (drive, motor):
            one.fmu.doStep(period * PERIOD_S, PERIOD_S)
        if period == 3 * 6000:
            drive.set(reference=-2.0)
        torques += motor.get("torque")
    seconds = (time.perf_counter() - began) / 4
    # Means of many periods of the injection, which the torque contains.
    torques = [sum(torques[end - 2400:end]) / 2400 for end in (3 * 6000, 4 * 6000)]
    print(f"torque {torques} Nm at 2 and -2 A, {seconds:.2f} s a simulated second")
    assert torques == pytest.approx([0.64, -0.64], abs=0.01)
    assert drive.get("i_q_ref_a", "state") == pytest.approx([-2.0, 2.0], abs=0.01)
    assert seconds < 2.0


def test_the_loop_closes_in_libcosim(tmp_path):
    """libcosim is an importer in C++, with a fixed step of whole nanoseconds; it steps both FMUs at once."""
    taken = ["i_a", "i_b", "dc_link", "heat_sink", "encoder"]
    pairs = [("motor", sensor, "drive", name) for sensor, name in zip(SENSORS, taken)]
    pairs += [("drive", name, "motor", name) for name in [*DUTIES, "enabled", "chopper", "relay"]]
    system = xml.Element("OspSystemStructure", version="0.1",
                         xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure")
    xml.SubElement(system, "BaseStepSize").text = f"{PERIOD_S:.9f}"
    xml.SubElement(system, "Algorithm").text = "fixedStep"
    simulators = xml.SubElement(system, "Simulators")
    for name in NAMES:
        file = str((FOLDER / f"{name}.fmu").resolve())
        xml.SubElement(simulators, "Simulator", name=name.removeprefix("induction-"), source=file)
    connections = xml.SubElement(system, "Connections")
    for pair in pairs:
        connection = xml.SubElement(connections, "VariableConnection")
        for simulator, name in (pair[:2], pair[2:]):
            xml.SubElement(connection, "Variable", simulator=simulator, name=name)
    xml.ElementTree(system).write(tmp_path / "OspSystemStructure.xml", "UTF-8", True)

    execution = CosimExecution.from_osp_config_file(str(tmp_path / "OspSystemStructure.xml"))
    command, seen = CosimManipulator.create_override(), CosimObserver.create_time_series(buffer_size=2400)
    assert execution.add_manipulator(command) and execution.add_observer(seen)
    drive, motor = (execution.slave_index_from_instance_name(name) for name in ("drive", "motor"))
    d, m = ({one.name.decode(): one.reference for one in execution.slave_variables(each)} for each in (drive, motor))
    seen.start_time_series(motor, m["torque"], CosimVariableType.REAL)
    torques, end = [], 0
    for amperes, periods in ((2.0, 3 * 6000), (-2.0, 6000)):
        command.slave_integer_values(drive, [d["mode"]], [1])
        command.slave_real_values(drive, [d["reference"]], [amperes])
        execution.step(periods)
        end += periods
        *_, values = seen.time_series_real_samples(motor, m["torque"], end - 2399, 2400)
        torques.append(sum(values) / 2400)
    print(f"torque {torques} Nm at 2 and -2 A in libcosim")
    assert torques == pytest.approx([0.64, -0.64], abs=0.01)


def test_a_refused_setting_is_named():
    motor = Instance(NAMES[1]).begin()
    with pytest.raises(Exception):
        motor.set(**{"motor.l_m": -1.0})
    assert motor.messages == ["motor.l_m = -1: out of range; allowed: 0.000001 to 1000 H"]
    assert motor.get("motor.r_s") == [5.4]
    with pytest.raises(Exception):
        motor.set(shaft=3.0)
    assert motor.messages[1:] == ["shaft = 3: allowed is 0 to 2"]
    # The ranges of the drive depend on each other, so they are checked together.
    drive = Instance(NAMES[0], **{"limits.current_a": 1e6})
    with pytest.raises(Exception):
        drive.begin()
    assert drive.messages[0].startswith("limits.current_a = 1000000")
    drive = Instance(NAMES[0]).begin()
    drive.fmu.setInteger([drive.references["mode"]], [1])
    drive.set(reference=50.0)
    drive.fmu.doStep(0.0, PERIOD_S)
    assert drive.messages[0].startswith("reference = 50 is limited to ")


@pytest.mark.parametrize("name, word, inputs, outputs", [
    (NAMES[0], "mode", {"i_a": 0.1, "i_b": -0.1}, ["duty_a", "duty_b", "phi_deg"]),
    (NAMES[1], "enabled", {"duty_a": 0.6, "duty_b": 0.5, "duty_c": 0.5}, ["i_a", "sensor_a", "flux"]),
])
def test_a_state_is_saved_and_restored_also_in_another_instance(name, word, inputs, outputs):
    one, other = Instance(name).begin(), Instance(name).begin()

    def later(instance):
        for period in range(600, 900):
            instance.fmu.doStep(period * PERIOD_S, PERIOD_S)
        return instance.get(*outputs)

    for instance in (one, other):
        instance.set(**inputs)
    one.fmu.setInteger([one.references[word]], [1])
    one.fmu.doStep(0.0, 600 * PERIOD_S)
    state = one.fmu.getFMUstate()
    first = later(one)
    assert first != later(other)
    one.fmu.setFMUstate(state)
    assert later(one) == first
    other.fmu.setFMUstate(state)
    assert later(other) == first
    one.fmu.freeFMUstate(state)
