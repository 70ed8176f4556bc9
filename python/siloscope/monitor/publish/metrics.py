"""What Prometheus scrapes. Everything is read from the store when it asks; nothing runs in between."""

from __future__ import annotations

from collections.abc import Iterator

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from sqlalchemy import Connection

from siloscope import _core
from siloscope.monitor.clock import SECOND
from siloscope.monitor.service import Service
from siloscope.monitor.store import alerts, deliveries, frames, live, places, readings, sync

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"

AMOUNTS = (
    ("volume_cubic_meters", "volume", "Volume of the content."),
    ("volume_std_cubic_meters", "volume_std", "Its standard deviation."),
    ("fill_ratio", "fill", "Volume by capacity."),
    ("mass_kilograms", "mass", "Mass of the content."),
    ("mass_std_kilograms", "mass_std", "Its standard deviation."),
    ("level_meters", "level", "Mean height of the surface over its datum."),
    ("coverage_ratio", "coverage", "Fraction of the surface that was seen."),
)
"""Gauges of every silo: name, column, help. A stale silo has none of them."""


class Collector:
    """The service's state as metrics."""

    def __init__(self, service: Service) -> None:
        self._service = service

    def collect(self) -> Iterator[Metric]:
        """All families."""
        with self._service.store.read() as connection:
            yield from self._silos(connection)
            yield from self._state(connection)
        yield from self._process()

    def _silos(self, connection: Connection) -> Iterator[Metric]:
        labels = ["site", "silo"]
        site = str(places.fact(connection, "name") or "")
        now = self._service.clock.now()
        families = {
            column: GaugeMetricFamily(f"siloscope_{name}", told, labels=labels) for name, column, told in AMOUNTS
        }
        times = GaugeMetricFamily(
            "siloscope_reading_timestamp_seconds", "When the newest answer was seen.", labels=labels
        )
        stale = GaugeMetricFamily("siloscope_stale", "1 where the newest answer is too old, or missing.", labels=labels)
        for silo in places.listed(connection, "silo"):
            last = readings.last(connection, silo.id, answered=True)
            old = last is None or now - last.time > silo.stale_after_s * SECOND
            stale.add_metric([site, silo.id], float(old))
            if last is None:
                continue
            times.add_metric([site, silo.id], last.time / SECOND)
            for column, family in families.items():
                value = getattr(last, column)
                if value is not None and not old:
                    family.add_metric([site, silo.id], value)
        yield from (*families.values(), times, stale)

    def _state(self, connection: Connection) -> Iterator[Metric]:
        counts = frames.counts(connection)
        queued = counts[frames.QUEUED] + counts[frames.MEASURING]
        yield GaugeMetricFamily("siloscope_frames_queued", "Frames that wait or are in work.", queued)
        failed = CounterMetricFamily("siloscope_frames_failed", "Frames that can't be used.", labels=["reason"])
        for reason, number in _by_kind(frames.failures(connection)).items():
            failed.add_metric([reason], number)
        yield failed
        pending = GaugeMetricFamily("siloscope_outbox_pending", "Undelivered things.", labels=["channel"])
        for channel, number in (deliveries.pending(connection) | sync.pending(connection)).items():
            pending.add_metric([channel], number)
        yield pending
        given_up = GaugeMetricFamily("siloscope_outbox_failed", "Things that are tried no more.", labels=["channel"])
        for channel, number in deliveries.given_up(connection).items():
            given_up.add_metric([channel], number)
        yield given_up
        firing = GaugeMetricFamily("siloscope_alerts_firing", "Alerts that are on.", labels=["silo", "kind"])
        for row in alerts.firing(connection):
            firing.add_metric([row.silo, row.kind], row.number)
        yield firing
        up = GaugeMetricFamily(
            "siloscope_live_camera_up", "1 while a camera that is driven gives frames.", labels=["camera"]
        )
        for camera, state in live.states(connection).items():
            up.add_metric([camera], float(state["state"] == live.OK))
        yield up

    def _process(self) -> Iterator[Metric]:
        measuring, (free, _) = self._service.measuring, self._service.blobs.free()
        measured = CounterMetricFamily("siloscope_frames_measured", "Frames measured since the start.", measuring.count)
        yield measured
        yield CounterMetricFamily("siloscope_measure_seconds", "Time the workers took for them.", measuring.seconds)
        yield GaugeMetricFamily("siloscope_disk_free_bytes", "Free space where the frames lie.", free)
        build = GaugeMetricFamily("siloscope_build_info", "The program.", labels=["version"])
        build.add_metric([_core.__version__], 1.0)
        yield build


def _by_kind(failures: dict[str, int]) -> dict[str, int]:
    """Failures by a word each: whole sentences name files and would be a series each."""
    found: dict[str, int] = {"lost": 0, "unusable": 0}
    for reason, number in failures.items():
        found["lost" if "measurement" in reason else "unusable"] += number
    return found


def text(service: Service) -> bytes:
    """The page that Prometheus reads."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(Collector(service))
    return generate_latest(registry)
