"""A scene in, a functional mock-up unit out."""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from fmu_build.build import build_fmu
    from fmu_build.errors import BuildError

__all__ = ["BuildError", "build_fmu"]

if not TYPE_CHECKING:
    _HOMES = {"BuildError": "errors", "build_fmu": "build"}

    def __getattr__(name):
        """Returns a public name, imported when it is first asked for: this package itself takes no time."""
        import importlib  # noqa: PLC0415

        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        module = importlib.import_module(f"fmu_build.{_HOMES[name]}")
        globals()[name] = value = getattr(module, name)
        return value

    def __dir__():
        """Returns what there is, public names that are not imported yet included."""
        return sorted({*globals(), *__all__})
