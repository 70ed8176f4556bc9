"""What Prometheus scrapes, read back by its own parser and checked by its own tool."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families

from monitor import farm
from monitor.farm import Farm
from siloscope.monitor.publish import metrics

LISTED = (
    *("volume_cubic_meters", "volume_std_cubic_meters", "fill_ratio", "mass_kilograms", "reading_timestamp_seconds"),
    *("frames_queued", "frames_failed", "measure_seconds", "outbox_pending", "disk_free_bytes", "alerts_firing"),
    "build_info",
)


def samples(service: Farm) -> dict[str, dict[tuple[str, ...], float]]:
    found: dict[str, Any] = {}
    for family in text_string_to_metric_families(metrics.text(service).decode()):
        found[family.name] = {
            tuple(value for _, value in sorted(one.labels.items())): one.value for one in family.samples
        }
    return found


def test_every_listed_metric_is_there_with_its_value(tmp_path: Path) -> None:
    service = farm.make(tmp_path, farm.rule("page"))
    farm.reading(service, fill=0.1)
    farm.look(service)
    found = samples(service)
    assert {f"siloscope_{name}" for name in LISTED} <= found.keys()
    assert found["siloscope_volume_cubic_meters"] == {("silo7", "Test"): pytest.approx(2.0)}
    assert found["siloscope_reading_timestamp_seconds"] == {("silo7", "Test"): farm.NOON / 1e6 + 1}
    assert found["siloscope_alerts_firing"] == {("low", "silo7"): 1.0}


def test_an_old_answer_has_no_number(tmp_path: Path) -> None:
    service = farm.make(tmp_path)
    farm.reading(service)
    service.clock.time += farm.LATE
    found = samples(service)
    assert found["siloscope_volume_cubic_meters"] == {}
    assert found["siloscope_stale"][("silo7", "Test")] == 1.0


@pytest.mark.skipif(shutil.which("promtool") is None, reason="promtool is not installed; `make services` installs it")
def test_prometheus_own_tool_takes_them(tmp_path: Path) -> None:
    """It would rather have grams, which nobody weighs a silo in."""
    service = farm.make(tmp_path, farm.rule("page"))
    farm.reading(service, fill=0.1)
    farm.look(service)
    command = ["promtool", "check", "metrics"]
    done = subprocess.run(command, input=metrics.text(service), capture_output=True, check=False)
    told = (done.stdout + done.stderr).decode().splitlines()
    assert [line for line in told if "kilograms" not in line] == []
    assert done.returncode == 3
