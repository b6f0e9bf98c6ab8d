"""Principal moments and axes of an inertia tensor in CasADi symbols, without branches.

CasADi may differentiate `principal` where the moments are distinct. `principal_forward` gives the same
derivative with fewer operations, and also the changes of moments that are equal.
"""

import casadi as ca

from supervessel.rotation.attitude import attitude_dot, unit

SWEEPS = 4
"""Sweeps of three rotations each.

Every rotation leaves one zero, and the other two elements soon shrink faster than quadratically. What is
left off the diagonal, over the largest moment, is at worst 1.5e-5 after 3 sweeps and 1.6e-20 after 4, far
below u = 1.1e-16: found by a search that climbs over positive definite tensors towards the largest. Over the
geometric mean of its two diagonal elements it is at worst 4e-11, in a tensor that is singular to rounding;
moments feel the square of that.
"""

TIE = 2.0**-40
"""Weight of the rule that decides between frames of equal scalar part: see `principal`."""

LEAST_SHARE, LEAST = 2.0**-900, 2.0**-1022
"""LEAST_SHARE times the largest moment, but at least LEAST, stands for the difference of two equal moments
where a difference divides.

Quotients by it are so large that they pass for infinity, and are still doubles.
"""

_Rows = list[list[ca.SX]]


def principal(inertia: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Returns the principal moments, (3,) [kg m2], ascending, and their axes, (3, 3), R_body_principal.

    inertia : (3, 3) [kg m2], symmetric, positive semidefinite, body axes; its upper triangle is read

    The columns are the axes, determinant +1; J = R diag(moments) R^T. Any scale will do as long as the
    elements are normal numbers below a quarter of the largest double. Moments are off by a few u of the
    largest; with J = D A D, D diagonal and A_ii = 1, each is off by a few u of itself times the condition
    number of A. A zero moment may come out negative by as much. A diagonal tensor gives its own
    diagonal, sorted, and unit vectors, to the last bit.

    An axis may point either way, so four proper frames are equally good. The one with the largest trace is
    taken: it is turned least from the body axes, its quaternion has the largest scalar part, at least 1/2.
    Where two frames tie, turned by some angle to either side, the choice must jump. Diagonal tensors with
    their moments out of order are such ties; so that noise of rounding size does not make these jump, TIE
    times the sum of elements, those of the first row counting four times and those of the second twice, is
    added to the trace. Of permutations the plain one wins if it is proper, scalar parts within 2^-38 of each
    other count as equal, and the jump is moved that much off the tie. The axes also jump where two moments
    meet, as their order does; at equal moments they are any axes orthogonal to the third.

    Source: [GVL] section 8.5, cyclic Jacobi method; [DV]: its accuracy for small moments.
    """
    A = [[inertia[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]
    V = [[ca.SX(float(i == j)) for j in range(3)] for i in range(3)]
    for _ in range(SWEEPS):
        for p, q in ((0, 1), (0, 2), (1, 2)):
            _rotate(A, V, p, q)
    moments = [A[0][0], A[1][1], A[2][2]]
    for p, q in ((0, 1), (1, 2), (0, 1)):
        _order(moments, V, p, q)
    return ca.vertcat(*moments), _least_turned(_orthonormal(_matrix(V)))


def quaternion_of_axes(R_body_principal: ca.SX) -> ca.SX:
    """Returns q_body_principal, (4,), of unit length and scalar part > 0.

    R_body_principal : (3, 3), trace at least 0, from `principal`
    4 w q at unit length, as in `attitude.quaternion`: with such a trace w is at least 1/2.
    """
    R = R_body_principal
    axis = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    return unit(ca.vertcat(1.0 + ca.trace(R), axis))


def principal_forward(moments: ca.SX, R_body_principal: ca.SX, d_inertia: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Returns the changes of the principal moments, (3,) [kg m2], and of q_body_principal, (4,).

    moments, R_body_principal : from `principal`, (3,) [kg m2] and (3, 3)
    d_inertia                 : dJ, (3, 3) [kg m2], symmetric, a small change of the tensor, body axes

    With v_i the axes and lambda_i the moments, moment i changes by v_i . dJ v_i and the frame turns about v_k
    by v_i . dJ v_j / (lambda_i - lambda_j), (i, j, k) cyclic: J R = R diag(lambda) differentiated. Both are
    linear in dJ, so the reverse derivative is the transpose. Equal moments are not differentiable: their
    changes are returned along the axes that `principal` happened to choose. The axes are not even continuous
    there: where dJ tilts them, the change of the quaternion is about 1e271 times dJ over the largest moment
    and stands for infinity. Jumps from one proper frame to another are left out.
    """
    change = R_body_principal.T @ d_inertia @ R_body_principal
    turn = ca.vertcat(
        *(change[i, j] / _gap(moments[i] - moments[j], moments[2]) for i, j in ((1, 2), (2, 0), (0, 1)))
    )
    return ca.diag(change), attitude_dot(quaternion_of_axes(R_body_principal), turn)


def _gap(difference: ca.SX, largest: ca.SX) -> ca.SX:
    """Returns the difference of two moments [kg m2], or where it is zero a small number to divide by."""
    return ca.if_else(difference == 0.0, ca.fmax(LEAST_SHARE * largest, LEAST), difference)


def _rotate(A: _Rows, V: _Rows, p: int, q: int) -> None:
    """Makes A[p][q] zero by a rotation in the plane p, q, by 45 degrees at most, added to V.

    With gap = A_qq - A_pp and off = A_pq the angle a of the rotation has tan 2a = 2 off/gap. tan a comes from
    off/gap where that is at most 1 in size, else from gap/(2 off): smooth wherever off or gap is not zero.
    Where off is zero, so is tan a, and nothing changes, to the last bit.
    Source: [GVL] section 8.5.
    """
    r = 3 - p - q
    off = A[p][q]
    gap = A[q][q] - A[p][p]
    slight = ca.fabs(off) <= ca.fabs(gap)
    # the numerator of the quotient that is not used is zero: the square of a huge moment would overflow
    ratio = ca.if_else(slight, off, 0.0) / ca.if_else(
        ca.logic_and(slight, gap != 0.0), gap, 1.0
    )  # half the tangent of twice the angle
    cotangent = ca.if_else(slight, 0.0, 0.5 * gap) / ca.if_else(slight, 1.0, off)  # of twice the angle
    backwards = cotangent < 0.0
    size = ca.if_else(backwards, -cotangent, cotangent)
    steep = 1.0 / (size + ca.sqrt(1.0 + cotangent * cotangent))
    t = ca.if_else(
        slight, 2.0 * ratio / (1.0 + ca.sqrt(1.0 + 4.0 * ratio * ratio)), ca.if_else(backwards, -steep, steep)
    )
    c = 1.0 / ca.sqrt(1.0 + t * t)
    s = t * c
    half = s / (1.0 + c)  # tangent of half the angle

    def turned(x: ca.SX, y: ca.SX) -> tuple[ca.SX, ca.SX]:
        return x - s * (y + half * x), y + s * (x - half * y)

    A[p][p], A[q][q] = A[p][p] - t * off, A[q][q] + t * off
    A[p][q] = A[q][p] = ca.SX(0.0)
    x, y = turned(A[r][p], A[r][q])
    A[r][p] = A[p][r] = x
    A[r][q] = A[q][r] = y
    for row in V:
        row[p], row[q] = turned(row[p], row[q])


def _order(moments: list[ca.SX], V: _Rows, p: int, q: int) -> None:
    """Swaps the moments p, q if they descend, and their axes so that V stays proper."""
    swap = moments[q] < moments[p]
    keep = 1.0 - swap
    moments[p], moments[q] = ca.fmin(moments[p], moments[q]), ca.fmax(moments[p], moments[q])
    for row in V:
        row[p], row[q] = keep * row[p] + swap * row[q], keep * row[q] - swap * row[p]


def _orthonormal(V: ca.SX) -> ca.SX:
    """Returns V = R_body_principal with its dozen roundings removed: one step towards the nearest rotation.

    The step gives V (3 E - V^T V)/2. V's small elements keep their relative accuracy.
    """
    return V + V @ (0.5 * (ca.SX.eye(3) - V.T @ V))


def _least_turned(R: ca.SX) -> ca.SX:
    """Returns the one of the four proper frames of R = R_body_principal that `principal` chooses."""
    a, b, c = ca.vertsplit(ca.diag(R) + TIE * (4.0 * R[0, :] + 2.0 * R[1, :] + R[2, :]).T)
    none, first, second, third = a + b + c, a - b - c, b - a - c, c - a - b
    others = ca.fmax(second, third)
    keep = none >= ca.fmax(first, others)
    about_first = ca.logic_and(ca.logic_not(keep), first >= others)
    turn = ca.logic_not(ca.logic_or(keep, about_first))
    about_second = ca.logic_and(turn, second >= third)
    about_third = ca.logic_and(turn, ca.logic_not(about_second))
    kept = [keep + about for about in (about_first, about_second, about_third)]
    return ca.horzcat(*(R[:, j] * (2.0 * k - 1.0) for j, k in enumerate(kept)))


def _matrix(rows: _Rows) -> ca.SX:
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))
