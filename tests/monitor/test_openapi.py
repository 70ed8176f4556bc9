"""The OpenAPI document is true: generated requests get the answers that it names, to the last status."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from monitor.servers import frame_bytes, serving, write_site

OPTIONS = (
    "--max-examples 2 --request-timeout 60 --seed 8480 --phases examples,coverage --suppress-health-check all "
    "--no-color --exclude-checks unsupported_method,positive_data_acceptance"
)
"""What a schema can't say (a place that is not there, a version that was not seen) is refused with 412, 422, 428."""

STREAM = "/api/v1/events"
"""An answer without an end; `test_changes` reads it."""


def test_generated_requests_get_documented_answers(tmp_path: Path) -> None:
    with serving(tmp_path / "data", write_site(tmp_path / "site")) as server:
        server.settled(server.post("cam7", frame_bytes(0.5), server.token("camera", "cam7")).json["frame"])
        (tmp_path / "openapi.json").write_bytes(server.get("/api/v1/openapi.json").body)
        command = [str(Path(sys.executable).with_name("schemathesis")), "run", "openapi.json", "--url", server.root]
        command += ["--header", f"Authorization: Bearer {server.token('admin')}", "--exclude-path", STREAM]
        command += OPTIONS.split()
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
        assert done.returncode == 0, done.stdout[-20_000:] + done.stderr[-2000:]
        assert server.get("/healthz").status == 200
        assert "Traceback" not in server.log()
