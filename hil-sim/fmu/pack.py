"""Packs the library as two FMUs. Arguments: the library, the program that prints the descriptions, and the folder of the FMUs.

The same library gives the same bytes. Folders `binaries/*` of other systems, which are given as further arguments, are packed too.
"""

import json
import platform
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree as xml

SYSTEMS = {"Linux": ("linux64", ".so"), "Darwin": ("darwin64", ".dylib"), "Windows": ("win64", ".dll")}
ROOT = Path(__file__).resolve().parents[2]
RATE_HZ = 6000


MOTOR = {"reference": 0, "causality": "parameter", "name": "motor",
         "about": "Name of a motor of the simulator, or path of a motor file; empty: the dissertation's"}


def model_description(told):
    """The text of modelDescription.xml, from what the program prints of an FMU."""
    name, version = told["name"], told["identifier"].split("-", 1)[1]
    root = xml.Element("fmiModelDescription", fmiVersion="2.0", modelName=name, guid=told["identifier"], version=version,
                       license="MIT OR Apache-2.0", generationTool=f"induction-drive {version}",
                       variableNamingConvention="structured", numberOfEventIndicators="0")
    xml.SubElement(root, "CoSimulation", modelIdentifier=name, canHandleVariableCommunicationStepSize="true",
                   canGetAndSetFMUstate="true")
    units = xml.SubElement(root, "UnitDefinitions")
    types = xml.SubElement(root, "TypeDefinitions")
    xml.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(1 / RATE_HZ))
    variables = xml.SubElement(root, "ModelVariables")
    structure = xml.SubElement(root, "ModelStructure")
    unknowns = [xml.SubElement(structure, kind) for kind in ("Outputs", "InitialUnknowns")]
    known = set()
    for index, one in enumerate([MOTOR, *told["variables"]], 1):
        label, causality, unit, words = one["name"], one["causality"], one.get("unit"), one.get("words")
        is_real = "start" in one and not words
        variability = "fixed" if causality == "parameter" else "continuous" if is_real else "discrete"
        about = one["about"]
        # Importers such as libcosim leave enumerations out, so that nobody could connect one.
        is_number = words and causality != "parameter"
        if is_number:
            about += ": " + ", ".join(f"{place} {word}" for place, word in enumerate(words))
        scalar = xml.SubElement(variables, "ScalarVariable", name=label, valueReference=str(one["reference"]),
                                description=about, causality=causality, variability=variability)
        kind = "Real" if is_real else "Integer" if is_number else "Enumeration" if words else "String"
        value = xml.SubElement(scalar, kind)
        start = int(one["start"]) if words else one.get("start", "")
        if is_number:
            value.set("min", "0")
            value.set("max", str(len(words) - 1))
        elif words:
            value.set("declaredType", label)
            kind = xml.SubElement(xml.SubElement(types, "SimpleType", name=label), "Enumeration")
            for place, word in enumerate(words):
                xml.SubElement(kind, "Item", name=word, value=str(place))
        elif one.get("range"):
            for attribute, bound in zip(("min", "max"), one["range"]):
                value.set(attribute, repr(bound))
        if unit:
            value.set("unit", unit)
        if causality == "output":
            for unknown in unknowns:
                # An output is a result of the last step: no input acts on it at once.
                xml.SubElement(unknown, "Unknown", index=str(index), dependencies="")
        else:
            value.set("start", str(start))
        if unit and unit not in known:
            known.add(unit)
            xml.SubElement(units, "Unit", name=unit)
    xml.indent(root)
    return xml.tostring(root, encoding="UTF-8", xml_declaration=True)


def main(library, descriptions, folder, *others):
    system, ending = SYSTEMS[platform.system()]
    for told in json.loads(subprocess.run([descriptions], check=True, capture_output=True).stdout):
        name = told["name"]
        files = {"modelDescription.xml": model_description(told),
                 f"binaries/{system}/{name}{ending}": Path(library).read_bytes()}
        for other in map(Path, others):
            file = next(other.iterdir())
            files[f"binaries/{other.name}/{name}{file.suffix}"] = file.read_bytes()
        for text in ("LICENSE-APACHE", "LICENSE-MIT"):
            files[f"documentation/licenses/{text}"] = (ROOT / text).read_bytes()
        path = Path(folder) / f"{name.replace('_', '-')}.fmu"
        with zipfile.ZipFile(path, "w") as fmu:
            for file, content in sorted(files.items()):
                info = zipfile.ZipInfo(file)
                info.compress_type = zipfile.ZIP_DEFLATED
                info.external_attr = 0o644 << 16
                fmu.writestr(info, content)
        print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main(*sys.argv[1:])
