"""The content of a prepared frame in a silo whose pose and lengths are known."""

from __future__ import annotations

import time
from dataclasses import replace

from siloscope.content.extras import with_vessel, without_obstacles
from siloscope.content.fitting import cut_behind_bare_wall, fitted
from siloscope.content.knowledge import filled_to
from siloscope.content.reading import Request, content_of, contradicted, refused
from siloscope.estimation.inputs import Prepared
from siloscope.types.calibration import Calibration
from siloscope.types.content import Content
from siloscope.vessel.vessel import Vessel


def content_in_silo(
    prepared: Prepared, silo: Calibration, about: Vessel, request: Request, prepare_ms: float
) -> Content:
    """Fits the surface over the floor and answers the request; `prepare_ms` is what the frame took until here."""
    start = time.perf_counter()
    known = filled_to(request.known, about)
    against = next((remark for remark in request.said if remark.refuses), None)
    if against is not None:
        return contradicted(request.data, against, request.said)
    if known.lengths.geometry.radius is None:
        return refused("radius-unknown", "no cylinder is seen", request.data, known)
    prepared = without_obstacles(prepared, known, about)
    if known.lengths.cone_only:
        known = cut_behind_bare_wall(prepared, known, request.sheet, silo)
    measured = fitted(prepared, known, request.sheet)
    times = {"prepare": prepare_ms, "measure": 1e3 * (time.perf_counter() - start)}
    config = {**prepared.config, **known.config}
    return with_vessel(content_of(replace(request, known=known), measured, config, times), about)
