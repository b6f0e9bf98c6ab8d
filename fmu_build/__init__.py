"""A scene in, a functional mock-up unit out."""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from fmu_build.build import build_fmu
    from fmu_build.errors import BuildError

__all__ = ["BuildError", "build_fmu"]

if not TYPE_CHECKING:

    def __getattr__(name):
        """Returns a public name, imported when it is first asked for: this package itself takes no time."""
        import importlib  # noqa: PLC0415

        homes = {"BuildError": "fmu_build.errors", "build_fmu": "fmu_build.build"}
        if name not in homes:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value = getattr(importlib.import_module(homes[name]), name)
        return value
