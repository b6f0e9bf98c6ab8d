"""What `make importers` needs beside its environment's own packages, and what a machine lacks of it.

    python tests/importers/tools.py     installs what pins.toml names, here and into build/importers

What cannot be installed is written down with the reason, for the table; nothing is left out silently.
"""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path
from xml.etree import ElementTree as ET

HERE = Path(__file__).parent
FOLDER = HERE.parents[1] / "build" / "importers"
PINS: dict[str, dict[str, str]] = tomllib.loads((HERE / "pins.toml").read_text(encoding="utf-8"))
COPY = "org.apache.maven.plugins:maven-dependency-plugin:3.6.1:copy-dependencies"
NAMES = {"vdmcheck2": "-Dmdep.stripVersion=true"}
"""How files of a Maven package are named where it looks for them by name; else by group, as two of those that
Maestro needs are called alike."""
UNPACKED = {"vdmcheck2": ("static-model.jar", "rule-model.jar", "vdmcheck2.jar")}
"""Archives that it looks into as folders."""
LACKING = FOLDER / "lacking.json"


def version(package: str) -> str:
    """Returns the pinned version of a package."""
    [found] = [table[package] for table in PINS.values() if package in table]
    return found


def lacking(package: str) -> str:
    """Returns why a package is not on this machine; "" if it is."""
    if not LACKING.exists():
        return "not installed: make importers installs it"
    found: dict[str, str] = json.loads(LACKING.read_text(encoding="utf-8"))
    return found.get(package, "")


def crate(name: str) -> Path:
    """Returns the command of a crate."""
    return FOLDER / "crates" / "bin" / name


def class_path(package: str) -> str:
    """Returns the Java class path of a Maven package and all that it needs."""
    return str(FOLDER / "jars" / package.partition(":")[2] / "*")


def _run(words: list[str], folder: Path, **environment: str) -> str:
    """Returns why a command failed; "" if it did not."""
    if not shutil.which(words[0]):
        return f"no {words[0]} on this machine"
    done = subprocess.run(
        words, cwd=folder, env=os.environ | environment, capture_output=True, text=True, check=False
    )
    if not done.returncode:
        return ""
    lines = [line for line in (done.stdout + done.stderr).splitlines() if "rror" in line]
    return f"{Path(words[0]).name} could not install it: {(lines or ['no reason given'])[0].strip()}"


def _pip(package: str, wanted: str) -> str:
    words = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    return _run([*words, f"{package}=={wanted}"], FOLDER)


def _cargo(package: str, wanted: str) -> str:
    """Compiles a crate; without optimisation, in less time.

    bindgen, which fmi-sim is compiled with, needs libclang, which a package has, and headers of a compiler.
    """
    if f'"{package} {wanted} ' in _text(FOLDER / "crates" / ".crates.toml"):
        return ""
    if not shutil.which("cc"):
        return "no cc on this machine"
    headers = subprocess.run(["cc", "-print-file-name=include"], capture_output=True, text=True, check=True)
    words = ["cargo", "install", package, "--version", wanted, "--locked", "--debug"]
    return _run(
        [*words, "--root", str(FOLDER / "crates"), "--target-dir", str(FOLDER / "target")],
        FOLDER,
        LIBCLANG_PATH=str(Path(sysconfig.get_path("purelib")) / "clang" / "native"),
        BINDGEN_EXTRA_CLANG_ARGS=f"-I{headers.stdout.strip()}",
    )


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


def _maven(package: str, wanted: str) -> str:
    """Copies a package and all that it needs into a folder of its own."""
    if not shutil.which("java"):
        return "no java on this machine"
    artifact = package.split(":")[1]
    folder, needed = FOLDER / "jars" / artifact, {package: wanted} | PINS[f"maven-{artifact}"]
    if _text(folder / "made.json") == json.dumps(needed):
        return ""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    project = ET.Element("project", xmlns="http://maven.apache.org/POM/4.0.0")
    own = {"modelVersion": "4.0.0", "groupId": "importers", "artifactId": artifact, "version": "1"}
    for key, value in own.items():
        ET.SubElement(project, key).text = value
    table = ET.SubElement(project, "dependencies")
    for name, number in needed.items():
        row, keys = ET.SubElement(table, "dependency"), ("groupId", "artifactId", "version")
        for key, value in zip(keys, [*name.split(":"), number], strict=True):
            ET.SubElement(row, key).text = value
    ET.ElementTree(project).write(folder / "pom.xml")
    options = [NAMES.get(artifact, "-Dmdep.prependGroupId=true"), "-DincludeScope=runtime"]
    reason = _run(["mvn", "-q", "-B", COPY, *options, "-DoutputDirectory=."], folder)
    if not reason:
        for unpacked in UNPACKED.get(artifact, ()):
            shutil.unpack_archive(folder / unpacked, folder, "zip")
        (folder / "made.json").write_text(json.dumps(needed), encoding="utf-8")
    return reason


def install() -> None:
    """Installs every pin and writes down what could not be installed."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    found = {}
    for registry, how in {"pypi": _pip, "crates": _cargo, "maven": _maven}.items():
        for package, wanted in PINS[registry].items():
            reason = how(package, wanted)
            if reason:
                found[package] = reason
                print(f"{package} {wanted}: {reason}", file=sys.stderr)
    LACKING.write_text(json.dumps(found, indent=1), encoding="utf-8")


if __name__ == "__main__":
    install()
