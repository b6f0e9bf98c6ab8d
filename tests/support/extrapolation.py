"""An integrator that shares nothing with Taylor series: the midpoint rule, extrapolated, in 60 digits."""

from collections.abc import Callable

from support.series import Number, Vector, mp


def midpoint_rule(
    ode: Callable[[Vector], Vector], state: Vector, time: Number, parts: int, columns: int
) -> Vector:
    """Returns the state after a time by Gragg's midpoint rule with 2, 4, 6 ... steps, extrapolated to none.

    parts   : into which the time is divided
    columns : of the table of extrapolation
    Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, section II.9.
    """
    with mp.workdps(60):
        for _ in range(parts):
            rows: list[list[Vector]] = []
            for j in range(1, columns + 1):
                h = time / parts / (2 * j)
                before, now = state, [x + h * y for x, y in zip(state, ode(state), strict=True)]
                for _ in range(2 * j - 1):
                    before, now = now, [x + 2 * h * y for x, y in zip(before, ode(now), strict=True)]
                row = [now]
                for k in range(1, j):
                    ratio = mp.mpf(j) ** 2 / mp.mpf(j - k) ** 2 - 1
                    row.append([a + (a - b) / ratio for a, b in zip(row[-1], rows[-1][k - 1], strict=True)])
                rows.append(row)
            state = rows[-1][-1]
    return state
