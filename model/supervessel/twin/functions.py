"""CasADi functions that check the numbers they are given."""

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from supervessel.problems import unknown

UNIT_SLACK = 1e-3
"""Largest difference from 1 of the length of an attitude in a call. The drift of a loose integration passes
(SciPy's rtol is 1e-3); a quaternion that was never normalised, or was rounded to two digits, does not."""

STATES = ("x", "x_ref")
"""Arguments whose first four elements are an attitude."""

BOUND = "bound"
"""The argument that is a bound of an error: not negative, infinite where none is known."""

SYMBOLS = (ca.SX, ca.MX)


class TwinFunction(ca.Function):
    """A CasADi function of the twin: a `ca.Function` that also checks the numbers it is called with.

    A call raises ValueError, with what is allowed, for missing and unknown arguments, for sizes other than
    the argument's (CasADi itself takes one number for a whole vector), for numbers that are not finite, and
    for attitudes whose length is not 1 within UNIT_SLACK; `ode`, `outputs` and `longest_step` take attitudes
    of any length. Of symbols only the sizes are checked. In a call by name u and acceleration_ref may be left
    out and are then zero; p may be left out and then has the scene's values. `map`, `mapaccum` and `fold`
    return functions that check in the same way.

    Example:
        >>> from supervessel import Twin, load_scene
        >>> twin = Twin(load_scene("examples/iss_dg.toml"))
        >>> twin.step(x=[1, 1, 0, 0, 0, 0, 0], h=0.1)
        Traceback (most recent call last):
        ValueError: step: the attitude in x has length 1.41421: must be 1; divide it by its length
    """

    def __init__(self, function: ca.Function, defaults: Mapping[str, ArrayLike], unit: bool = True) -> None:
        super().__init__(function)
        self._defaults = {name: np.ravel(value) for name, value in defaults.items()}
        self._unit = unit
        self._sizes: dict[str, tuple[int, int]] = {name: self.size_in(name) for name in self.name_in()}

    def __call__(self, *args: Any, **named: Any) -> Any:
        """Returns the results: one value, or a tuple of values; of a call by name a dictionary by name.

        Raises ValueError, see the class.
        """
        names = list(self._sizes)
        if named and args:
            raise ValueError(f"{self.name()}: arguments are either all named or all in order")
        if args and len(args) != len(names):
            raise ValueError(f"{self._form()}: {len(args)} arguments given, {len(names)} wanted")
        given = dict(zip(names, args, strict=True)) if args else self._completed(named)
        checked = {name: self._checked(name, value) for name, value in given.items()}
        return super().__call__(**checked) if named else super().__call__(*checked.values())

    def map(self, *args: Any) -> "TwinFunction":
        """Returns the function of many columns, as `ca.Function.map` does.

        Example:
            >>> twin.ode.map(5)(x=twin.x_start, u=np.zeros((3, 5)))["x_dot"].shape
            (7, 5)
        """
        return self.like(super().map(*args))

    def mapaccum(self, *args: Any) -> "TwinFunction":
        """Returns the function applied again and again with all its results, as `ca.Function.mapaccum`.

        Example:
            >>> twin.step.mapaccum(5)(x=twin.x_start, u=np.zeros((3, 5)), h=0.1)["x_next"].shape
            (7, 5)
        """
        return self.like(super().mapaccum(*args))

    def fold(self, *args: Any) -> "TwinFunction":
        """Returns the function applied again and again with the last result, as `ca.Function.fold`.

        Example:
            >>> twin.step.fold(5)(x=twin.x_start, u=np.zeros((3, 5)), h=0.1)["x_next"].shape
            (7, 1)
        """
        return self.like(super().fold(*args))

    def like(self, function: ca.Function) -> "TwinFunction":
        """Returns another function of the same arguments, checked in the same way.

        Example:
            >>> twin.step.like(twin.step.expand())(x=twin.x_start, h=0.1)["x_next"].shape
            (7, 1)
        """
        return TwinFunction(function, self._defaults, self._unit)

    def in_place(self) -> tuple[Callable[[], None], dict[str, NDArray[np.float64]]]:
        """Returns `run` and arrays by the names of arguments and results, for loops in Python.

        run() takes the arguments from their arrays and leaves the results in theirs: about a microsecond
        where generated C is called; a call with arrays takes fifty times that. What may be left out of a
        call by name stands in its array, the others are zero. Numbers are not checked.

        Example:
            >>> run, at = twin.generate("build/twin", ["step"], derivatives=0)["step"].in_place()
            >>> at["x"][:], at["h"][:] = twin.x_start, 0.1
            >>> for _ in range(10):
            ...     run()
            ...     at["x"][:] = at["x_next"]
            >>> float(np.linalg.norm(at["x"][:4])) - 1.0 < 1e-15
            True
        """
        buffer, trigger = self.buffer()
        arrays = {}
        for i, name in enumerate((*self.name_in(), *self.name_out())):
            argument = i < self.n_in()
            rows, columns = self.size_in(name) if argument else self.size_out(name)
            flat = np.zeros(rows * columns)
            if argument:
                buffer.set_arg(i, memoryview(flat))  # type: ignore[arg-type, call-arg]
            else:
                if self.nnz_out(name) != flat.size:
                    raise ValueError(f"{self.name()}: {name} is sparse: not for in_place")
                buffer.set_res(i - self.n_in(), memoryview(flat))  # type: ignore[arg-type, call-arg]
            arrays[name] = flat if columns == 1 else flat.reshape((rows, columns), order="F")
            if name in self._defaults:
                arrays[name].T[:] = self._defaults[name]
        # CasADi holds bare addresses of these; nothing else may keep them alive.
        trigger.kept = (buffer, *arrays.values())
        return trigger, arrays

    def _form(self) -> str:
        return f"{self.name()}({', '.join(self._sizes)})"

    def _completed(self, named: Mapping[str, Any]) -> dict[str, Any]:
        """Returns all arguments of a call by name: those given, and the defaults of those left out."""
        names = list(self._sizes)
        for name in named:
            if name not in names:
                raise ValueError(f"{self._form()}: {unknown('argument', name, names)}")
        given = dict(named)
        for name in names:
            if name in given:
                continue
            if name in self._defaults:
                given[name] = self._defaults[name]
            elif 0 not in self._sizes[name]:
                raise ValueError(f"{self._form()}: {name} is missing")
        return given

    def _checked(self, name: str, value: Any) -> Any:
        """Returns an argument in a form that CasADi takes. Raises ValueError, see the class."""
        rows, columns = self._sizes[name]
        if isinstance(value, list | tuple) and any(isinstance(element, SYMBOLS) for element in value):
            value = ca.vertcat(*value)
        symbolic = isinstance(value, SYMBOLS)
        array = value if symbolic else self._numbers(name, value)
        shape = tuple(array.shape) if len(array.shape) == 2 else (array.size, 1)
        # CasADi maps over more columns than wanted and repeats fewer, where one divides the other.
        fits = shape[0] == rows and 0 in (shape[1] % columns, columns % max(shape[1], 1))
        if not (fits or shape == (columns, rows) or (rows == 0 and 0 in shape)):
            wanted = f"{_size((rows, columns))} wanted{self._hint(name)}"
            raise ValueError(f"{self.name()}: {name} holds {_size(shape)}: {wanted}")
        if symbolic:
            return value
        if name == BOUND:
            if not (array >= 0.0).all():
                said = f"{self.name()}: {name} = {array.ravel().tolist()}"
                raise ValueError(f"{said}: must be >= 0, inf where no bound is known")
        elif not np.isfinite(array).all():
            raise ValueError(f"{self.name()}: {name} = {array.ravel().tolist()}: must be finite")
        if name == "h" and BOUND in self._sizes and not (array > 0.0).all():
            raise ValueError(f"{self.name()}: h = {array.ravel().tolist()}: must be > 0: bounds only grow")
        if self._unit and name in STATES:
            self._check_attitudes(name, array.reshape(shape if fits else (rows, columns)))
        if not array.size:
            return ca.DM(rows, columns)
        return value if isinstance(value, float | int | ca.DM) else array  # which CasADi takes faster

    def _numbers(self, name: str, value: Any) -> NDArray[np.float64]:
        try:
            return value.full() if isinstance(value, ca.DM) else np.array(value, dtype=float)
        except (TypeError, ValueError):
            raise ValueError(
                f"{self.name()}: {name} = {value!r}: must be numbers or CasADi symbols"
            ) from None

    def _check_attitudes(self, name: str, states: NDArray[np.float64]) -> None:
        lengths = np.linalg.norm(states[:4], axis=0)
        wrong = lengths[np.abs(lengths - 1.0) > UNIT_SLACK]
        if wrong.size:
            raise ValueError(
                f"{self.name()}: the attitude in {name} has length {wrong[0]:.6g}: must be 1; "
                "divide it by its length"
            )

    def _hint(self, name: str) -> str:
        if name == "u" and self._sizes[name][0] == 0:
            return ': the scene has no torque input; put "torque = true" under [inputs]'
        return ""


def _size(shape: tuple[int, ...]) -> str:
    rows, columns = shape
    return f"{rows} number{'' if rows == 1 else 's'}" if columns == 1 else f"{rows} by {columns}"
