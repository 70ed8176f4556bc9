"""The paper's figures, drawn from our runs; imported only when one is drawn."""

from siloscope.paper.evaluation.figures.charts import bars, scatter
from siloscope.paper.evaluation.figures.clouds import adjusted, sensors, spread
from siloscope.paper.evaluation.figures.curves import discharges, together

__all__ = ["adjusted", "bars", "discharges", "scatter", "sensors", "spread", "together"]
