"""The dock tree: which vessel hangs on which port of which other, from the root outwards."""

from collections.abc import Iterator
from dataclasses import dataclass

from supervessel.scene import Scene


@dataclass(frozen=True)
class Joint:
    """A mated pair of ports, seen from the root: the parent is placed before the child."""

    parent: str
    parent_port: str
    child: str
    child_port: str

    @property
    def ports(self) -> tuple[str, str]:
        """Names of the two ports, "vessel.port", the parent's first."""
        return f"{self.parent}.{self.parent_port}", f"{self.child}.{self.child_port}"


def joints(scene: Scene) -> Iterator[Joint]:
    """Yields the docks of a scene so that every parent is the root or the child of an earlier joint."""
    neighbours: dict[str, list[tuple[str, str, str]]] = {vessel: [] for vessel in scene.vessels}
    for dock in scene.docks:
        (one, one_port), (other, other_port) = (port.split(".") for port in dock.ports)
        neighbours[one].append((one_port, other, other_port))
        neighbours[other].append((other_port, one, one_port))
    placed, waiting = {scene.root}, [scene.root]
    while waiting:
        parent = waiting.pop(0)
        for parent_port, child, child_port in neighbours[parent]:
            if child not in placed:
                placed.add(child)
                waiting.append(child)
                yield Joint(parent, parent_port, child, child_port)
