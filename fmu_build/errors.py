"""What can go wrong on the way from a scene to an FMU."""


class BuildError(RuntimeError):
    """An FMU that could not be built; the message says where and why."""
