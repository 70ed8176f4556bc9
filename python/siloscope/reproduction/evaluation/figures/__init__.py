"""The paper's figures, drawn from our runs; imported only when one is drawn."""

from siloscope.reproduction.evaluation.figures.charts import bars, scatter
from siloscope.reproduction.evaluation.figures.clouds import adjusted, sensors, spread
from siloscope.reproduction.evaluation.figures.curves import discharges, together

__all__ = ["adjusted", "bars", "discharges", "scatter", "sensors", "spread", "together"]
