"""Random examples of a property: a few in `make test`, many in `make thorough`."""

import os

from hypothesis import Phase, settings

from support.fmus import THOROUGH


def examples(few: int, many: int) -> settings:
    """Returns settings by which a property is tested with as many examples, the same ones each time."""
    count = many if THOROUGH in os.environ else few
    return settings(
        deadline=None, derandomize=True, max_examples=count, phases=(Phase.explicit, Phase.generate)
    )
