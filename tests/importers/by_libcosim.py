"""libcosimpy: OSP's libcosim, its fixed-step algorithm, an override manipulator and a last-value observer."""

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from importers.flight import Flight, InsteadError, Series, series


def fly(flight: Flight) -> Series:
    """Flies; inputs are overridden between steps, which are whole nanoseconds."""
    execution = CosimExecution.from_step_size(round(flight.step * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(str(flight.fmu), "it"))
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    if slave < 0 or not execution.add_manipulator(manipulator) or not execution.add_observer(observer):
        raise InsteadError("did not take the FMU")
    wanted = [flight.references[name] for name in flight.outputs]
    reals, flags = flight.reals, sorted(flight.booleans)
    points = []
    for k in range(len(flight.times) - 1):
        done = manipulator.slave_real_values(
            slave, [flight.references[n] for n in reals], flight.at(k, reals)
        )
        if flags:
            values = [bool(value) for value in flight.at(k, flags)]
            done &= manipulator.slave_boolean_values(slave, [flight.references[n] for n in flags], values)
        if not done or not execution.step():
            raise InsteadError(f"step {k + 1} failed")
        points.append(observer.last_real_values(slave, wanted))
    return series(flight.outputs, [points[0], *points])  # it does not show values before the first step
