"""C macros about flows of propellant."""

from supervessel.equations import Equations
from supervessel.scene.inputs import FLOW


def flow_constants(model: Equations) -> dict[str, int]:
    """Returns macros about flows, none in a scene without them.

    FLOW_COUNT : number of flows, which stand one after the other
    FLOW_PLACE : place of the first one among the inputs u
    """
    places = [i for i, variable in enumerate(model.resolved.acting) if variable.kind is FLOW]
    return {"FLOW_COUNT": len(places), "FLOW_PLACE": places[0]} if places else {}
