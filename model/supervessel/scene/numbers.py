"""Numbers as a scene may write them, and the inequalities that a mass distribution obeys."""

import math
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator

from supervessel.problems import quantity

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

EPSILON = 2.0**-52
# k1 + k2 >= k3 is judged on decimals read from text: each is off by u = EPSILON/2 relative, the sum by one
# u more, so a body on the boundary shows an excess of up to 4 u k3.
TRIANGLE_SLACK = 2.0 * EPSILON
# Range of a tolerance that may be asked for; doubles cannot show a smaller error.
LEAST_TOLERANCE, LARGEST_TOLERANCE = 1e-15, 0.1
# Eigenvalues of a symmetric 3x3 matrix are computed to a few u of the largest one.
EIGENVALUE_SLACK = 16.0 * EPSILON


class WrittenNumber(float):
    """A number with the text of the file that it is from: its last digit says how far it is rounded.

    text : as the file has it
    """

    text: str

    def __new__(cls, text: str) -> "WrittenNumber":
        number = super().__new__(cls, text)
        number.text = text
        return number

    def __getnewargs__(self) -> tuple[str]:  # type: ignore[override]
        return (self.text,)


def is_number(value: object) -> bool:
    """Whether `value` is an integer or float (not a Boolean) that a double holds as a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def number(
    unit: str, allowed: str, low: float = -math.inf, high: float = math.inf, *, open_low: bool = False
) -> BeforeValidator:
    """Returns a pydantic validator for one finite number from `low` to `high`; `allowed` says so in words."""

    def check(value: object) -> float:
        if is_number(value):
            x = float(value)  # type: ignore[arg-type]
            if (x > low or (x == low and not open_low)) and x <= high:
                return x
        raise ValueError(f" = {quantity(value, unit)}: must be {allowed}")

    return BeforeValidator(check)


def vector(unit: str, allowed: str, size: int = 3, low: float = -math.inf) -> BeforeValidator:
    """Returns a pydantic validator for `size` finite numbers >= `low`; `allowed` says so in words."""

    def check(value: object) -> tuple[float, ...]:
        if (
            isinstance(value, list | tuple)
            and len(value) == size
            and all(is_number(element) and float(element) >= low for element in value)
        ):
            return tuple(float(element) for element in value)
        raise ValueError(f" = {quantity(value, unit)}: must be {allowed}")

    return BeforeValidator(check)


def _tensor(value: object) -> Matrix:
    """Returns a tensor that is given by three rows, or by its diagonal."""
    unit = "kg m2"
    where = f" = {quantity(value, unit)}: "
    if isinstance(value, list | tuple) and len(value) == 3 and all(map(is_number, value)):
        x, y, z = map(float, value)
        return ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z))
    if not (
        isinstance(value, list | tuple)
        and len(value) == 3
        and all(
            isinstance(row, list | tuple) and len(row) == 3 and all(is_number(x) for x in row)
            for row in value
        )
    ):
        raise ValueError(where + "must be three finite numbers, the diagonal, or three rows of them")
    tensor = np.array(value, dtype=float)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        if tensor[i, j] != tensor[j, i]:
            here, there = f"[{i + 1},{j + 1}] = {tensor[i, j]}", f"[{j + 1},{i + 1}] = {tensor[j, i]}"
            raise ValueError(f"{where}must be symmetric, but {here} and {there}")
    xx, xy, xz, _, yy, yz, _, _, zz = tensor.ravel().tolist()
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def triangle_problem(moments: Vector) -> str:
    """Returns why no rigid body has these three moments of inertia, or "" if one may have them.

    moments : about three perpendicular axes, in any unit, each >= 0
    Equality within TRIANGLE_SLACK is accepted.
    Source: [CV] eqs. (3-5): the squares of the sample points' distances must not be negative.
    """
    small, middle, large = sorted(moments)
    excess = large - (small + middle)
    if excess <= TRIANGLE_SLACK * large:
        return ""
    return f"{large} exceeds {small} + {middle} by {excess:.6g}; no rigid body has these moments"


def tensor_problem(tensor: NDArray[np.float64], size: float = 0.0) -> str:
    """Returns why no rigid body has this inertia tensor, or "" if one may have it.

    tensor : (3, 3) [kg m2], about the centre of mass, symmetric, finite
    size   : of the largest number from which it was made [kg m2], where that may be larger than the tensor
    Principal moments must not be negative and must obey the triangle inequality, both within EIGENVALUE_SLACK
    of the largest, or of `size`.
    """
    moments: list[float] = np.linalg.eigvalsh(
        tensor
    ).tolist()  # sums beyond all floats are inf without a warning
    slack = EIGENVALUE_SLACK * max(size, *map(abs, moments))
    three = ", ".join(f"{moment:.10g}" for moment in moments)
    if moments[0] < -slack:
        return f"must be positive semidefinite, but its principal moments are {three} kg m2"
    excess = moments[2] - (moments[0] + moments[1])
    if excess > slack:
        return (
            f"its principal moments are {three} kg m2: {moments[2]:.10g} exceeds {moments[0]:.10g} + "
            f"{moments[1]:.10g} by {excess:.6g}; no rigid body has these moments"
        )
    return ""


def vector_length(v: Vector) -> float:
    """Returns the length of a vector, without under- or overflow."""
    return math.hypot(*v)


def _direction(value: Any) -> Vector:
    if not any(value):
        raise ValueError(f" = {quantity(value)}: must have a length greater than 0")
    x, y, z = value
    return x, y, z


def _course(value: object) -> tuple[tuple[float, float | bool], ...]:
    """Returns how an input moves: rows of time [s] and value; two rows at one time are a jump."""
    where = f" = {quantity(value)}: must be "
    if not (isinstance(value, list | tuple) and value and all(map(_is_row, value))):
        raise ValueError(where + "rows [time in s, value] of finite numbers, at least one")
    rows = tuple((float(time), x if isinstance(x, bool) else float(x)) for time, x in value)
    times = [time for time, _ in rows]
    if times[0] < 0.0:
        raise ValueError(f"{where}from time 0 s on, but begins at {times[0]} s")
    for i, (one, other) in enumerate(pairwise(times), start=2):
        if other < one:
            raise ValueError(f"{where}in the order of time, but row {i}, at {other} s, follows {one} s")
        if i > 2 and other == times[i - 3]:
            raise ValueError(f"{where}at most two values at one time, but has three at {other} s")
    return rows


def _is_row(row: object) -> bool:
    """Whether this is a time and a value; a value may be true or false."""
    if not (isinstance(row, list | tuple) and len(row) == 2 and is_number(row[0])):
        return False
    return isinstance(row[1], bool) or is_number(row[1])


Mass = Annotated[float, number("kg", "a finite number >= 0", 0.0)]
Pmi = Annotated[Vector, vector("m2", "three finite numbers >= 0", low=0.0)]
Moments = Annotated[Vector, vector("kg m2", "three finite numbers")]
Tensor = Annotated[Matrix, BeforeValidator(_tensor)]
Position = Annotated[Vector, vector("m", "three finite numbers")]
Direction = Annotated[
    Vector,
    BeforeValidator(_direction),
    vector("", "three finite numbers, a direction of any length > 0"),
]  # validators run from the right
Velocity = Annotated[Vector, vector("m/s", "three finite numbers")]
Mu = Annotated[float, number("m3/s2", "a finite number > 0", 0.0, open_low=True)]
LARGEST_PLACE = 1e100
"""[m], [m/s], in a field of gravity: squares and cubes of components up to this are doubles."""
WheelInertia = Annotated[float, number("kg m2", "a finite number >= 0", 0.0)]
LARGEST_MOMENTUM = 1e100
"""Of a wheel [N m s], either way: what it does to a rate is a double."""
WheelMomentum = Annotated[
    float,
    number("N m s", f"a number up to {LARGEST_MOMENTUM:g} either way", -LARGEST_MOMENTUM, LARGEST_MOMENTUM),
]
AngularVelocity = Annotated[Vector, vector("rad/s", "three finite numbers")]
Seconds = Annotated[float, number("s", "a finite number > 0", 0.0, open_low=True)]
Angle = Annotated[float, number("rad", "a number from 1e-6 to 1", 1e-6, 1.0)]
AttitudeError = Annotated[float, number("rad", "a number from 1e-15, what doubles tell, to 1", 1e-15, 1.0)]
RateError = Annotated[float, number("rad/s", "a finite number > 0", 0.0, open_low=True)]
Tolerance = Annotated[
    float,
    number(
        "", f"a number from {LEAST_TOLERANCE:g} to {LARGEST_TOLERANCE:g}", LEAST_TOLERANCE, LARGEST_TOLERANCE
    ),
]
Course = Annotated[tuple[tuple[float, float | bool], ...], BeforeValidator(_course)]
Bounds = Annotated[tuple[float, float], vector("", "two finite numbers [low, high]", size=2)]

# A quotient, a root and the sum under it leave the square of a normalised quaternion within 6 u of 1; what is
# that close stays as it is, so that a scene that is written out is read as the same.
UNIT_SLACK = 3.0 * EPSILON


def _attitude(value: Any) -> tuple[float, float, float, float]:
    scale = max(abs(component) for component in value)
    if scale == 0.0:
        raise ValueError(f" = {quantity(value)}: must have a length greater than 0")
    if abs(math.fsum(component * component for component in value) - 1.0) <= UNIT_SLACK:
        w, x, y, z = value
        return w, x, y, z
    scaled = [component / scale for component in value]
    norm = math.sqrt(math.fsum(component * component for component in scaled))
    w, x, y, z = (component / norm for component in scaled)
    return w, x, y, z


Attitude = Annotated[
    tuple[float, float, float, float],
    BeforeValidator(_attitude),
    vector("", "four finite numbers [w, x, y, z]", size=4),
]
