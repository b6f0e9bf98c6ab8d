"""What a scene file says: its tables, numbers, names, and the inputs and outputs that it asks for."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from supervessel.scene.schema import Scene

__all__ = ["Scene"]


def __getattr__(name: str) -> Any:
    """Returns Scene, looked up when it is asked for: what the schema needs reads the tables beside it."""
    if name == "Scene":
        from supervessel.scene.schema import Scene  # noqa: PLC0415

        return Scene
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
