"""Rotation of docked spacecraft: scene schema, symbolic model, numpy reference and CasADi twin."""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from supervessel import reference
    from supervessel.fmu import choose
    from supervessel.loading import load_scene, parse_scene
    from supervessel.problems import AccuracyError, SceneError
    from supervessel.scene.schema import Scene
    from supervessel.twin import Twin

__all__ = ["AccuracyError", "Scene", "SceneError", "Twin", "choose", "load_scene", "parse_scene", "reference"]

if not TYPE_CHECKING:
    _HOMES = {
        "AccuracyError": "problems",
        "Scene": "scene",
        "SceneError": "problems",
        "Twin": "twin",
        "choose": "fmu",
        "load_scene": "loading",
        "parse_scene": "loading",
        "reference": "reference",
    }

    def __getattr__(name):
        """Returns a public name, imported when it is first asked for: this package itself takes no time."""
        import importlib  # noqa: PLC0415

        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        module = importlib.import_module(f"supervessel.{_HOMES[name]}")
        globals()[name] = value = module if name == "reference" else getattr(module, name)
        return value

    def __dir__():
        """Returns what there is, public names that are not imported yet included."""
        return sorted({*globals(), *__all__})
