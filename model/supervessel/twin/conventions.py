"""The twin's equations in the forms of other packages, each imported only when it is asked for."""

from typing import TYPE_CHECKING, Any

import casadi as ca

from supervessel.scene.inputs import TORQUE

if TYPE_CHECKING:
    from supervessel.twin import Twin


def acados_model(twin: "Twin", step: float | None) -> Any:
    """Returns an `AcadosModel`; arguments, contents and errors are those of `Twin.to_acados`."""
    from acados_template import AcadosModel  # noqa: PLC0415

    model = AcadosModel()
    model.name = twin.scene.name
    model.x, model.u, model.p = twin.x, twin.u, twin.p if twin.p_names else []
    model.xdot = ca.SX.sym("xdot", twin.x.numel())
    model.f_expl_expr = twin.ode(twin.x, twin.u, twin.p)
    model.f_impl_expr = model.xdot - model.f_expl_expr
    if step is not None:
        model.disc_dyn_expr = twin.step(twin.x, twin.u, twin.p, step)
    return model


def do_mpc_model(twin: "Twin", step: float | None) -> Any:
    """Returns a `do_mpc.model.Model`; arguments, contents and errors are those of `Twin.to_do_mpc`."""
    from do_mpc.model import Model  # noqa: PLC0415

    model = Model("continuous" if step is None else "discrete", "SX")
    attitude = model.set_variable("_x", "attitude", (4, 1))
    rate = model.set_variable("_x", "angular_velocity", (3, 1))
    name = "torque" if all(variable.kind is TORQUE for variable in twin.u_variables) else "u"
    states = {"attitude": attitude, "angular_velocity": rate}
    if len(twin.x_names) > 7:
        states["momentum"] = model.set_variable("_x", "momentum", (len(twin.x_names) - 7, 1))
    x, u = ca.vertcat(*states.values()), model.set_variable("_u", name, (len(twin.u_names), 1))
    p = model.set_variable("_p", "p", (len(twin.p_names), 1)) if twin.p_names else ca.SX(0, 1)
    right = twin.ode(x, u, p) if step is None else twin.step(x, u, p, step)
    places = {"attitude": slice(0, 4), "angular_velocity": slice(4, 7), "momentum": slice(7, None)}
    for name in states:
        model.set_rhs(name, right[places[name]])
    return model
