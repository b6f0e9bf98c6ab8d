"""What accuracy costs in a scene: laws, propagators and steps flown as FMUs, compared and timed."""

from fmu_build.flight.experiment import course_of
from fmu_build.trade.plotting import plot
from fmu_build.trade.study import is_trade, study
from fmu_build.trade.table import choices_table, drift_table, table
from supervessel.problems import TradeError

__all__ = ["TradeError", "choices_table", "course_of", "drift_table", "is_trade", "plot", "study", "table"]
