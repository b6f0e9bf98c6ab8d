"""Linear models of the error state, in CasADi symbols. They are the same for each form of the error.

e = (phi, d_omega, d_h), (6 + n,) [rad, rad/s, N m s], is a small error of the state in body axes, see
`error_state`, h being the momenta of n wheels; du and dp are small changes of the inputs u that act, (m,),
and of the other inputs p, (n,).
"""

import casadi as ca

from supervessel.twin.error_state import tangent


def linear_model(state: ca.SX, torque: ca.SX, p: ca.SX, acceleration: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Returns A (k, k), B (k, m), E (k, n) of e' = A e + B du + E dp about a state; k is the size of e.

    state        : q_inertial_body, omega [rad/s], body axes, and momenta of wheels [N m s]
    torque       : u, (m,) [N m, N]
    p            : (n,)
    acceleration : omega' [rad/s2], body axes, and h' [N m], expressions of state, torque and p
    phi' = d_omega - omega x phi: `error_state.error_rate` to first order. The block of A from phi to d_omega'
    is zero but in a field of gravity, whose torque alone depends on the attitude.
    """
    omega, by_state = state[4:7], ca.jacobian(acceleration, state)
    above = ca.horzcat(-ca.skew(omega), ca.SX.eye(3), ca.SX(3, acceleration.numel() - 3))
    A = ca.vertcat(above, ca.horzcat(by_state[:, :4] @ tangent(state[:4]), by_state[:, 4:]))
    B = ca.vertcat(ca.SX(3, torque.numel()), ca.jacobian(acceleration, torque))
    E = ca.vertcat(ca.SX(3, p.numel()), ca.jacobian(acceleration, p))
    return ca.densify(A), ca.densify(B), ca.densify(E)


def discrete_model(state: ca.SX, torque: ca.SX, p: ca.SX, end: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Returns A (k, k), B (k, m), E (k, n) of e_end = A e + B du + E dp over one step; k is the size of e.

    state  : at the start of the step: q_inertial_body, omega [rad/s], body axes, momenta of wheels [N m s]
    torque : u, (m,) [N m, N], held over the step
    p      : (n,), held over the step
    end    : the state at the end of the step, an expression of state, torque and p
    With T(q) = `error_state.tangent`, (4, 3), dq = T phi and phi = 4 T^T dq: for a unit attitude T^T T is a
    quarter of the unit matrix.
    """
    others = ca.SX.eye(state.numel() - 4)
    begun = ca.diagcat(tangent(state[:4]), others)
    ended = ca.diagcat(4.0 * tangent(end[:4]).T, others)
    by_state, by_torque, by_p = (ended @ ca.jacobian(end, known) for known in (state, torque, p))
    return ca.densify(by_state @ begun), ca.densify(by_torque), ca.densify(by_p)
