"""Prints a bill of materials in CycloneDX's JSON without addresses, which differ by where one looks.

Run by `make constraints` on what cyclonedx-py has found in an environment with the package alone.
"""

import json
import sys
from pathlib import Path

ADDRESSES = ("$schema", "externalReferences")


def without_addresses(found: object) -> object:
    """Returns a bill with no references to places outside it."""
    if isinstance(found, dict):
        return {key: without_addresses(value) for key, value in found.items() if key not in ADDRESSES}
    return [without_addresses(value) for value in found] if isinstance(found, list) else found


if __name__ == "__main__":
    print(json.dumps(without_addresses(json.loads(Path(sys.argv[1]).read_text())), indent=1, sort_keys=True))
