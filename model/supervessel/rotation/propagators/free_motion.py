"""Free rotation of a rigid body over a span of any length, in closed form.

Axes are principal, moments J0 <= J1 <= J2. The body rates are Jacobi functions of time, the attitude follows
from them and one integral of the third kind. No elliptic integral is evaluated: a series starts everything
at a small share of the span, and addition theorems double it until the whole span is covered.

The axes are named so that rate 2 never changes sign, [FM] eqs. (4), (5): where it would, axes 0 and 2 are
exchanged, and where it is negative the body is turned by pi about axis 0. With l the length of the angular
momentum and T the energy, [FM] eqs. (3), (6),

    G = 2 T J2 - l^2    H = l^2 - 2 T J0    E = l^2 - 2 T J1    P = J0 J1 J2
    A = H (J2 - J1)/P   B = G (J1 - J0)/P   A - B = E (J2 - J0)/P

and S' = C D, C' = -A S D, D' = -B S C, S = 0 and C = D = 1 at first, [FM] eq. (7): S sqrt(A), C, D are
Jacobi's sn, cn, dn. The turn is conj(p(0)) R p(t), [FM] eq. (19), where p takes the momentum's direction in
the body to axis 2 the shortest way and R is a rotation about axis 2 by the angle psi,
psi' = (2 T + l w2)/(l + L2), [FM] eq. (21). psi is the sum of the angle of the motion that starts at S = 0,
which is c0 t + chi, [FM] eqs. (22), (23), and of one arctangent for where on its path the body starts.
Source: [FM], the derivation equation by equation, from Jacobi's and Weierstrass's functions and their
addition theorems.

Derivatives are right wherever the moments are distinct, and by rates and time wherever. Their error is some
roundings, times J2/J0 for a spin about axis 0. At a spin about axis 1 the smaller rates are to be 0 or above
1e-145 of the greatest: below, products of two of them underflow, and C D with them after 300/sqrt(A).
"""

import casadi as ca

from supervessel.rotation.attitude import unit

FIRST_ANGLE = 0.25
"""Largest phase, as of `phase`, that the series covers."""

LARGEST_TURN = 2e9
"""Most that a step turns the body [rad], at the rate it begins with: what u of it leaves is 2e-7 rad.

A spin that is steady needs no doublings however long it lasts: they are no limit.
"""

SERIES_TERMS = 8
"""Highest power of t^2 in the series of Weierstrass's function.

[FM] eq. (13). The nearest pole other than that at 0 is at a phase of pi or beyond: terms decrease by
(FIRST_ANGLE/pi)^2 each.
"""

INTEGRAL_TERMS = 9
"""Terms of chi's series, [FM] eq. (24).

Its nearest pole is at pi/2 or beyond, so that terms decrease by (FIRST_ANGLE 2/pi)^2 each. chi is some
5e-3 of c0 t there at the most, so that 2e-14 of chi suffice.
"""

FLOOR = 2.0**-500
"""Added to C and D, which fall off exponentially where the body stays at, or comes near, a spin about axis 1.

Their squares, by which the rates are divided, must not underflow.
"""

NEGLIGIBLE = 2.0**-57
"""Bound [rad] of the last arctangent below which it is left out, close to a spin about axis 2.

There its argument is that of 0. The arctangent is of the fourth order in the other rates, [FM] eq. (39), and
so is what leaving it out loses.
"""

VARYING = 4
"""How many of the first elements of the recurrence's state `double` changes: S, C, D, chi."""

CLOSE = 2.0**-20
"""Square of the sine of the angle between momentum and axis 2 that counts as close."""

SPLITTER = 2.0**27 + 1.0

Triple = tuple[ca.SX, ca.SX, ca.SX]
Pair = tuple[ca.SX, ca.SX]  # unevaluated sum, the second term small


def phase(moments: ca.SX, omega: ca.SX, time: ca.SX) -> ca.SX:
    """Returns how far the motion goes along its path, |t| sqrt(A) [rad].

    `start` takes a share 2^-n of the time such that phase * 2^-n <= FIRST_ANGLE, and n doublings follow.

    moments : (3,), ascending, the largest in [0.5, 1)
    omega   : (3,), principal axes, the largest component in [0.5, 1), or 0
    time    : of either sign

    Scales of mass and time are the caller's; powers of two keep everything exact.
    """
    _, moving, span = _guarded(omega, time)
    J0, J1, J2 = ca.vertsplit(moments)
    w0, _, w2 = ca.vertsplit(moving)
    exchanged = J2 * (J2 - J1) * (w2 * w2) < J0 * (J1 - J0) * (w0 * w0)
    J, w, _ = named(moments, moving, exchanged)
    _, H = invariants(J, w)
    return ca.fabs(span) * ca.sqrt(H * (J[2] - J[1]) / (J[0] * J[1] * J[2]))


def start(moments: ca.SX, omega: ca.SX, time: ca.SX, share: ca.SX) -> ca.SX:
    """Returns the state of the recurrence at time * share, (13,): S, C, D, chi, then what stays.

    share : 2^-n, with n as `phase` demands
    What stays is A, B, A - B, N, c, r, l, c0 and the sign of the exchange.
    Source: [FM] eqs. (6), (22), (25) to (27), and the series of `_series`.
    """
    _, moving, span = _guarded(omega, time)
    E = separation(moments, moving)
    exchanged = E < 0.0
    J, w, _ = named(moments, moving, exchanged)
    (J0, J1, J2), (w0, w1, w2) = J, w
    G, H = invariants(J, w)
    width, lower = J2 - J0, J1 - J0
    per_product = 1.0 / (J0 * J1 * J2)
    A, B = H * (J2 - J1) * per_product, G * lower * per_product
    A_less_B = ca.fabs(E) * ca.fabs(width) * per_product

    L0, L1, L2 = J0 * w0, J1 * w1, J2 * w2
    length = ca.sqrt(L0 * L0 + L1 * L1 + L2 * L2)
    square = L2 * L2 + J1 * J2 * lower / ca.if_else(width == 0.0, 1.0, width) * (w1 * w1)
    none = square == 0.0
    peak = ca.if_else(none, L2, ca.sqrt(ca.if_else(none, 1.0, square)))  # L2 where S = 0
    per_sum = 1.0 / (length + peak)
    per_J2 = J0 * J1 * per_product
    rate = (L0 * w0 + L1 * w1 + L2 * w2 + length * peak * per_J2) * per_sum  # c0

    # of the integral's pole, and of the momentum's direction on the path from S = 0, C + i r S;
    # [FM] eqs. (25) to (27)
    lean = width * (J1 * per_product)
    N = lower * H / (J0 * J0 * J1)
    c, r = length * lean * N, peak * lean
    S, C, D, integral = _series(A, B, peak * per_sum, span * share)
    chi = G * B * (peak * per_J2) * (per_sum * per_sum) * integral
    sign = ca.if_else(exchanged, -1.0, 1.0)
    return ca.vertcat(S, C, D, chi, A, B, A_less_B, N, c, r, length, rate, sign)


def double(s: ca.SX) -> ca.SX:
    """Returns the state of the recurrence at twice the time.

    S, C, D by duplication, [FM] eqs. (15), (16); chi by the addition theorem of the third kind, which adds
    one arctangent, [FM] eq. (37). No sum here cancels, except where the result is near a zero.
    """
    S, C, D, chi, A, B, A_less_B, N, c, r = ca.vertsplit(s)[:10]
    SS, CC, DD = S * S, C * C, D * D
    p, q = CC * DD, A_less_B * SS
    over = 1.0 / (CC + A * SS * DD)
    S2, C2, D2 = 2.0 * S * (C * D) * over, (p - q) * over + FLOOR, (p + q) * over + FLOOR
    SS2 = S2 * S2
    # D's rounding error would grow where D stays near 1; that of D^2 + B S^2 = 1 shows it
    D2 = D2 + 0.5 * D2 * (1.0 - B * SS2 - D2 * D2)
    re, im = 1.0 + N * (SS2 - SS * (C2 * D2)), -c * SS * S2
    y, y2 = r * S, r * S2
    re, im = complex_product((re, im), complex_product((CC - y * y, 2.0 * C * y), (C2, -y2)))
    return ca.vertcat(S2, C2, D2, 2.0 * chi + ca.atan2(im, re), s[VARYING:])


def finish(moments: ca.SX, omega: ca.SX, time: ca.SX, s: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Returns the body's turn, (4,), unit, and its rate at the end, (3,), principal axes.

    s : state of the recurrence at `time`

    The attitude at the end is attitude * turn. The turn's sign is continuous in time, (1, 0, 0, 0) at 0.
    Source: [FM] eqs. (17), (18) for the rates, (38) for psi, (19), (20) for the turn.
    """
    rest, moving, span = _guarded(omega, time)
    S, C, D, chi, A, _, _, _, _, r, length, rate, sign = ca.vertsplit(s)
    exchanged = sign < 0.0
    J, w, flip = named(moments, moving, exchanged)
    (J0, J1, J2), (w0, w1, w2) = J, w
    G, H = invariants(J, w)
    width, lower, upper = J2 - J0, J1 - J0, J2 - J1
    per_product = 1.0 / (J0 * J1 * J2)
    per_J0, per_J1, per_J2 = J1 * J2 * per_product, J0 * J2 * per_product, J0 * J1 * per_product

    # rates: addition theorems with the rates and their derivatives now, [FM] eqs. (17), (18)
    e0, e1, e2 = -upper * per_J0 * (w1 * w2), width * per_J1 * (w2 * w0), -lower * per_J2 * (w0 * w1)
    per_d = 1.0 / (C * C + S * S * (w2 * w2) * (width * upper * (J2 * per_product)))
    v0 = (w0 * C + e0 * (S * D)) * per_d
    v1 = (w1 * (C * D) + e1 * S) * per_d
    v2 = (w2 * D + e2 * (S * C)) * per_d

    # psi, [FM] eq. (38)
    x0, y0, x1, y1 = J0 * w0, J1 * w1, J0 * v0, J1 * v1
    f = lower * (J1 * per_J0)
    Sw = S * w1
    re = sign * (G + f * J2 * (v1 * v1 - Sw * (width * per_J1 * (v0 * v2))))
    im = -sign * (length * f * (width * per_J0) * (Sw * v1))
    re, im = complex_product(complex_product((re, im), (C, r * S)), (x0 * x1 + y0 * y1, y0 * x1 - x0 * y1))
    small = _square(G * (lower * G)) <= NEGLIGIBLE**2 * _square(J2 * length * (upper * H)) * A
    close = ca.logic_or(x0 * x0 + y0 * y0 <= CLOSE * (length * length), width == 0.0)
    omitted = ca.logic_and(small, close)
    half = 0.5 * (rate * span + chi + ca.atan2(ca.if_else(omitted, 0.0, im), ca.if_else(omitted, 1.0, re)))

    # conj(z0, y0, -x0, 0) * (cos, 0, 0, sin) * (z1, y1, -x1, 0)
    cos, sin = ca.cos(half), ca.sin(half)
    z0, z1 = length + J2 * w2, length + J2 * v2
    a0, a1, a2, a3 = z1 * cos, y1 * cos + x1 * sin, y1 * sin - x1 * cos, z1 * sin
    q0, q1, q2, q3 = ca.vertsplit(
        unit(
            ca.vertcat(
                z0 * a0 + y0 * a1 - x0 * a2,
                z0 * a1 - y0 * a0 + x0 * a3,
                z0 * a2 + y0 * a3 + x0 * a0,
                z0 * a3 - y0 * a2 - x0 * a1,
            )
        )
    )

    def own(first: ca.SX, second: ca.SX, third: ca.SX) -> ca.SX:
        third = flip * third
        return ca.vertcat(
            ca.if_else(exchanged, third, first), sign * flip * second, ca.if_else(exchanged, first, third)
        )

    turn, end = ca.vertcat(q0, own(q1, q2, q3)), own(v0, v1, v2)
    return ca.if_else(rest, ca.vertcat(1.0, 0.5 * time * omega), turn), ca.if_else(rest, omega, end)


def free_turn(moments: ca.SX, omega: ca.SX, time: ca.SX, doublings: int) -> tuple[ca.SX, ca.SX]:
    """Returns what `finish` does, after as many doublings as it takes.

    doublings : the most there is room for

    Where more are needed, or the body turns by more than LARGEST_TURN, all results are NaN.
    """
    angle = phase(moments, omega, time)
    needed = [angle > FIRST_ANGLE * 2.0**i for i in range(doublings + 1)]
    beyond = ca.logic_or(needed[-1], ca.sumsqr(omega * time) > LARGEST_TURN**2)
    share = ca.SX(1.0)
    for more in needed[:-1]:
        share = share * ca.if_else(more, 0.5, 1.0)
    s = start(moments, omega, time, share)
    for more in needed[:-1]:
        s = ca.vertcat(ca.if_else(more, double(s)[:VARYING], s[:VARYING]), s[VARYING:])
    turn, end = finish(moments, omega, time, s)
    return ca.if_else(beyond, ca.SX.nan(), turn), ca.if_else(beyond, ca.SX.nan(), end)


def _guarded(omega: ca.SX, time: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Returns whether the body is at rest, then rates and time; if it is, other rates and no time."""
    rest = ca.logic_and(ca.logic_and(omega[0] == 0.0, omega[1] == 0.0), omega[2] == 0.0)
    return rest, ca.vertcat(omega[:2], ca.if_else(rest, 1.0, omega[2])), ca.if_else(rest, 0.0, time)


def named(moments: ca.SX, omega: ca.SX, exchanged: ca.SX) -> tuple[Triple, Triple, ca.SX]:
    """Returns moments and rates by the names of the axes used here, and -1 where the body is turned by pi.

    Source: [FM] eqs. (4), (5).
    """
    J0, J1, J2 = ca.vertsplit(moments)
    w0, w1, w2 = ca.vertsplit(omega)
    first, third = ca.if_else(exchanged, w2, w0), ca.if_else(exchanged, w0, w2)
    flip = ca.if_else(third < 0.0, -1.0, 1.0)
    second = ca.if_else(exchanged, -flip, flip) * w1
    J = ca.if_else(exchanged, J2, J0), J1, ca.if_else(exchanged, J0, J2)
    return J, (first, second, flip * third), flip


def invariants(J: Triple, w: Triple) -> Pair:
    """Returns G and H, [FM] eq. (3), without cancellation."""
    a, b, c = (J[i] * (w[i] * w[i]) for i in range(3))
    return (J[2] - J[0]) * a + (J[2] - J[1]) * b, (J[1] - J[0]) * b + (J[2] - J[0]) * c


def separation(moments: ca.SX, omega: ca.SX) -> ca.SX:
    """Returns E = J2 (J2 - J1) w2^2 - J0 (J1 - J0) w0^2, good to rounding where the two terms cancel.

    [FM] eq. (3). Near the separatrix the period goes with log E. Each term is made as an unevaluated sum of
    two doubles, by Dekker's formulas for what rounding takes from a difference and from a product.
    """
    J0, J1, J2 = ca.vertsplit(moments)
    a, a_rest = _term(J2, J2 - J1, (J2 - (J2 - J1)) - J1, omega[2])
    b, b_rest = _term(J0, J1 - J0, (J1 - (J1 - J0)) - J0, omega[0])
    return (a - b) + (a_rest - b_rest)


def _term(J: ca.SX, difference: ca.SX, rest: ca.SX, w: ca.SX) -> Pair:
    """Returns J (difference + rest) w^2."""
    a, a_rest = _exact_product(J, difference)
    b, b_rest = _exact_product(w, w)
    whole, whole_rest = _exact_product(a, b)
    return whole, whole_rest + (a * b_rest + (a_rest + J * rest) * b)


def _exact_product(a: ca.SX, b: ca.SX) -> Pair:
    """Returns a b as rounded, and what that leaves."""
    a_high, b_high = (SPLITTER * x - (SPLITTER * x - x) for x in (a, b))
    a_low, b_low = a - a_high, b - b_high
    product = a * b
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _series(A: ca.SX, B: ca.SX, kappa: ca.SX, t: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Returns S, C, D at a small t, and the integral of v/(1 - kappa B v) up to there, v = (1 - D)/B.

    1/v = 2 (W + h) where W is Weierstrass's function, so that v t^-2 is a quotient of 1 and a short series.
    Source: [FM] eqs. (10) to (14), (24).
    """
    square = t * t
    x, y = A * square, B * square
    h = (4.0 * x + y) * (1.0 / 12.0)
    two_xy = 2.0 * x * y
    eight_hh = 8.0 * h * h
    terms = {
        1: h,
        2: (1.5 * eight_hh - two_xy) * (1.0 / 20.0),
        3: (h * (eight_hh - two_xy) + 0.125 * y * two_xy) * (1.0 / 28.0),
    }
    for n in range(4, SERIES_TERMS + 1):
        pairs = [terms[m] * terms[n - m] * (1.0 if 2 * m == n else 2.0) for m in range(2, n // 2 + 1)]
        terms[n] = (3.0 / ((2 * n + 1) * (n - 3))) * _sum(pairs)
    inverse = 1.0 / (1.0 + _sum([terms[n] for n in range(SERIES_TERMS, 0, -1)]))
    lack = 0.5 * y * inverse  # 1 - D
    per_square = inverse * (1.0 - 0.5 * lack)  # (S/t)^2
    S, C = t * ca.sqrt(per_square), ca.sqrt(1.0 - x * per_square)

    terms[1] = h - 0.5 * kappa * y
    inverted = [ca.SX(1.0)]
    for n in range(1, INTEGRAL_TERMS):
        inverted.append(-_sum([terms[m] * inverted[n - m] for m in range(min(n, SERIES_TERMS), 0, -1)]))
    integral = _sum([inverted[n] * (1.0 / (2 * n + 3)) for n in range(INTEGRAL_TERMS - 1, -1, -1)])
    return S, C, 1.0 - lack, 0.5 * t * square * integral


def _sum(terms: list[ca.SX]) -> ca.SX:
    """Returns the sum, the first terms first."""
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


def _square(x: ca.SX) -> ca.SX:
    return x * x


def complex_product(a: Pair, b: Pair) -> Pair:
    """Returns the product of two complex numbers."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]
