"""The table of what scenes cost in MEASURED.md, with times in plain RK4 steps of C: `make bench`."""

import tempfile
from pathlib import Path

from run import build_host, names_of, times, unpack

from supervessel import parse_scene
from support.costs import table_raw, table_row


def main() -> None:
    """Prints the table."""
    print("| scene | operations: composite | all | library, kB | step | all inputs changing |")
    print("|---|---:|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as name:
        host = build_host("host", Path(name))
        for number, (title, raw) in enumerate(table_raw().items()):
            scene = parse_scene(raw)
            folder = Path(name, str(number))
            folder.mkdir()
            library, description = unpack(scene, folder)
            names = [names_of(description, causality) for causality in ("input", "output")]
            taken = times(host, library, description, *names)
            print(f"{table_row(title, scene)} {taken['step'][1]} | {taken['set+step+get,changing'][1]} |")


if __name__ == "__main__":
    main()
