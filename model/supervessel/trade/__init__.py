"""What accuracy costs in a scene: laws, propagators and steps flown as FMUs, compared and timed."""

from supervessel.trade.experiment import TradeError, course_of
from supervessel.trade.study import is_trade, study
from supervessel.trade.table import choices_table, drift_table, plot, table

__all__ = ["TradeError", "choices_table", "course_of", "drift_table", "is_trade", "plot", "study", "table"]
