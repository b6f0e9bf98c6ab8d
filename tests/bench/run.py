"""What a step of the FMU costs, in plain RK4 steps of C compiled with the same flags: `make bench`.

Builds the ISS with a DeltaGlider, loads the library natively and times setting inputs, stepping and getting
outputs in short rounds, each beside the plain step. Quote the ratios: the speed of machines drifts.
"""

import platform
import subprocess
import sys
import tempfile
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.model_description import ModelDescription

from fmu_build import build_fmu
from fmu_build.compile.compiler import FLAGS, fmi_headers
from fmu_build.platforms import host_platform
from supervessel import load_scene
from supervessel.scene.schema import Scene

HERE = Path(__file__).parent
SCENE = HERE.parent.parent / "examples" / "iss_dg.toml"
STEPS = 2000
LAWS = ("none", "decoupled", "principal", "tensor")
SHOWN = ("mass", "attitude")
MEANINGS = {
    "set+step+get": "set inputs, step, get outputs",
    "set+step+get,changing": "the same, values changing",
    "step": "step alone",
    "step+get": "step, get outputs",
    "get": "get outputs that are current",
    "set": "set inputs to what they are",
}


def build_host(name: str, folder: Path) -> Path:
    """Returns a program of this folder that loads a library, compiled with the FMU's own flags."""
    host = folder / name
    flags = [flag for flag in FLAGS if flag not in ("-std=c99", "-shared", "-fPIC", "-fvisibility=hidden")]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", host_platform().target, "-std=gnu99", *flags]
    command += ["-isystem", str(fmi_headers()), f"-I{HERE.parent / 'support'}", str(HERE / f"{name}.c")]
    command += ["-o", str(host), "-lm", "-ldl"]
    subprocess.run(command, check=True)
    return host


def by_rk4(scene: Scene) -> Scene:
    """Returns a scene whose steps are the plain step's own: what is timed is what comes on top."""
    return scene.model_copy(update={"rotation": scene.rotation.model_copy(update={"propagator": "rk4"})})


def unpack(scene: Scene, folder: Path) -> tuple[Path, ModelDescription]:
    """Returns the library for this machine of a scene's FMU, built in a folder, and its model description."""
    fmu = build_fmu(scene, folder / f"{scene.name}.fmu")
    unpacked = Path(extract(str(fmu), str(folder / scene.name)))
    library = unpacked / "binaries" / host_platform().name / f"{scene.name}{host_platform().suffix}"
    return library, read_model_description(str(fmu))


def times(
    host: Path, library: Path, description: ModelDescription, inputs: list[str], outputs: list[str]
) -> dict[str, tuple[str, str]]:
    """Returns nanoseconds and plain RK4 steps, as printed, of each case of MEANINGS and of a plain step."""
    references = {v.name: v.valueReference for v in description.modelVariables}
    numbers = [str(n) for names in (inputs, outputs) for n in (len(names), *(references[x] for x in names))]
    command = [str(host), str(library), description.guid, str(STEPS), *numbers]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    return {case: (nanoseconds, ratio) for case, nanoseconds, ratio in map(str.split, lines)}


def names_of(description: ModelDescription, causality: str) -> list[str]:
    """Returns the names of the variables of a causality."""
    return [v.name for v in description.modelVariables if v.causality == causality]


def main() -> None:
    """Prints the table, for the torque alone and for every input and output."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        library, description = unpack(by_rk4(load_scene(SCENE)), folder)
        host = build_host("host", folder)
        inputs, outputs = (names_of(description, causality) for causality in ("input", "output"))
        flown = [n for n in outputs if n.startswith(("attitude", "angular_velocity"))]
        torque = [n for n in inputs if n.startswith("torque")]
        print(
            f"{platform.system()} {platform.machine()}, ISS with a DeltaGlider, one sub-step of 1 ms a step\n"
        )
        print("| inputs set, outputs got | | ns | plain RK4 steps |\n|---|---|---:|---:|")
        for some, got in ((torque, flown), (inputs, outputs)):
            for case, (nanoseconds, ratio) in times(host, library, description, some, got).items():
                what = MEANINGS.get(case, "a plain RK4 step")
                print(f"| {len(some)}, {len(got)} | {what} | {nanoseconds} | {ratio} |")
        print("\n| law | step alone, plain RK4 steps | with the output error_bound |\n|---|---:|---:|")
        for law in LAWS:
            ratios = [
                step_alone(host, with_law(law, names), folder) for names in (SHOWN, (*SHOWN, "error_bound"))
            ]
            print(f"| `{law}` | {' | '.join(ratios)} |")


def with_law(law: str, names: tuple[str, ...]) -> Scene:
    """Returns the scene with a law and these outputs, turning about all axes."""
    scene = by_rk4(load_scene(SCENE))
    rotation = scene.rotation.model_copy(update={"law": law, "angular_velocity": (0.01, -0.02, 0.03)})
    outputs = scene.outputs.model_copy(update={"names": names})
    name = f"{law}_{len(names)}"
    return scene.model_copy(update={"name": name, "rotation": rotation, "outputs": outputs})


def step_alone(host: Path, scene: Scene, folder: Path) -> str:
    """Returns what a step takes in which nothing is set and got, in plain RK4 steps, as printed."""
    library, description = unpack(scene, folder)
    return times(host, library, description, [], [])["step"][1]


if __name__ == "__main__":
    main()
