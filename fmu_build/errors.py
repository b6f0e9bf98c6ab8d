"""What can go wrong on the way from a scene to an FMU."""

from supervessel.problems import shown_message


class BuildError(RuntimeError):
    """An FMU that could not be built; the message says where and why, in lines that can be shown."""

    def __init__(self, message: str) -> None:
        super().__init__(shown_message(message))
