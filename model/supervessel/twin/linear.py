"""Linear models of the error state, in CasADi symbols. They are the same for each form of the error."""

import casadi as ca

from supervessel.twin.error_state import tangent


def linear_model(state: ca.SX, torque: ca.SX, p: ca.SX, acceleration: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Returns A (6, 6), B (6, m), E (6, n): rate of a small error by the error, the torque, the inputs p.

    acceleration : (3,) [rad/s2], expression of state (7,), torque (m,) and p (n,)
    The error is (phi, d_omega): phi' = d_omega - omega x phi. The block of A from phi to d_omega' is zero: no
    torque here depends on the attitude.
    """
    omega = state[4:]
    A = ca.blockcat([[-ca.skew(omega), ca.SX.eye(3)], [ca.SX(3, 3), ca.jacobian(acceleration, state)[:, 4:]]])
    B = ca.vertcat(ca.SX(3, torque.numel()), ca.jacobian(acceleration, torque))
    E = ca.vertcat(ca.SX(3, p.numel()), ca.jacobian(acceleration, p))
    return ca.densify(A), ca.densify(B), ca.densify(E)


def discrete_model(state: ca.SX, torque: ca.SX, p: ca.SX, end: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Returns A (6, 6), B (6, m), E (6, n): a small error at a step's end by that at its start, torque, p.

    end : (7,), the state after the step, expression of state (7,), torque (m,) and p (n,)
    The error is (phi, d_omega). With T(q) = `tangent(q)`, dq = T phi and phi = 4 T^T dq.
    """
    begun = ca.diagcat(tangent(state[:4]), ca.SX.eye(3))
    ended = ca.diagcat(4.0 * tangent(end[:4]).T, ca.SX.eye(3))
    by_state, by_torque, by_p = (ended @ ca.jacobian(end, known) for known in (state, torque, p))
    return ca.densify(by_state @ begun), ca.densify(by_torque), ca.densify(by_p)
