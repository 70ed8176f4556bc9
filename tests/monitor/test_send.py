"""The client and the command that sends frames."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from monitor.servers import Server, frame_bytes
from siloscope.cli import main
from siloscope.client import Client, ServiceError
from siloscope.errors import InputError


def test_frames_are_sent_once_and_deleted_when_they_are_safe(
    shared: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "token").write_text(shared.token("camera", "cam7") + "\n")
    folder = tmp_path / "frames"
    folder.mkdir()
    for name, level in (("20261101T060000Z.png", 0.31), ("20261101T070000Z.png", 0.32)):
        (folder / name).write_bytes(frame_bytes(level))
    (folder / "notes.html").write_bytes(b"<html>no frame</html>")
    (folder / ".part").write_bytes(b"unfinished")
    command = ["send", str(folder), "--to", shared.root, "--camera", "cam7", "--token-file", str(tmp_path / "token")]
    assert main([*command, "--json"]) == 5
    assert json.loads(capsys.readouterr().out) == {"schema": "siloscope.send/1", "sent": 2, "known": 0, "refused": 1}
    assert main([*command, "--delete", "--json"]) == 5
    assert json.loads(capsys.readouterr().out)["known"] == 2
    assert sorted(path.name for path in folder.iterdir()) == [".part", "notes.html"]
    times = [frame["captured"] for frame in Client(shared.root).get("/api/v1/frames", {"camera": "cam7"})["items"]]
    assert {"2026-11-01T06:00:00Z", "2026-11-01T07:00:00Z"} <= set(times)


def test_the_client_tells_what_may_be_tried_again(shared: Server, tmp_path: Path) -> None:
    (tmp_path / "frame.png").write_bytes(frame_bytes(0.33))
    with pytest.raises(ServiceError) as refused:
        Client(shared.root, "wrong").send("cam7", tmp_path / "frame.png")
    assert (refused.value.status, refused.value.slug, refused.value.passing) == (401, "unauthorized", False)
    with pytest.raises(ServiceError) as silent:
        Client("http://127.0.0.1:9").silos()
    assert (silent.value.slug, silent.value.passing) == ("unreachable", True)
    with pytest.raises(InputError, match="no address"):
        Client("example")


def test_the_client_reads_what_the_service_has(shared: Server) -> None:
    client = Client(shared.root)
    assert [silo["id"] for silo in client.silos()] == ["silo7"]
    assert client.now("silo7")["silo"] == "silo7"
    assert len(list(client.readings("silo7", since=0.0))) == len(list(client.readings("silo7")))
    assert isinstance(list(client.alerts("firing")), list)
