"""The files of deploy/, as far as this machine can try them."""

from __future__ import annotations

import shutil
import socket
import subprocess
import urllib.request
from pathlib import Path

import pytest

from monitor.servers import Server, eventually

DEPLOY = Path(__file__).parents[2] / "deploy"

NGINX = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")


@pytest.mark.skipif(NGINX is None, reason="nginx is not installed; `make services` installs it")
def test_the_service_answers_below_a_sub_path_of_nginx(shared: Server, tmp_path: Path) -> None:
    """What the document says, with another address of the service; events come while they happen."""
    with socket.create_server(("127.0.0.1", 0)) as sock:
        port = sock.getsockname()[1]
    location = (DEPLOY / "nginx.conf").read_text().replace("http://127.0.0.1:8480", shared.root)
    paths = "".join(
        f"{name}_temp_path {tmp_path}/{name};" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    http = f"access_log off; {paths} server {{ listen 127.0.0.1:{port}; {location} }}"
    config = tmp_path / "nginx.conf"
    config.write_text(f"daemon off; pid {tmp_path}/pid; error_log {tmp_path}/log; events {{}} http {{ {http} }}")
    process = subprocess.Popen([str(NGINX), "-c", str(config)], stderr=subprocess.DEVNULL)
    try:
        root = f"http://127.0.0.1:{port}/silos"
        eventually(lambda: _listens(port))
        headers = {"Authorization": f"Bearer {shared.token('read')}"}
        with urllib.request.urlopen(
            urllib.request.Request(f"{root}/api/v1/silos", headers=headers), timeout=30
        ) as found:
            assert found.status == 200
        with urllib.request.urlopen(
            urllib.request.Request(f"{root}/api/v1/events", headers=headers), timeout=30
        ) as events:
            assert events.readline() == b"retry: 2000\n"
    finally:
        process.terminate()
        process.wait(30)


def _listens(port: int) -> bool:
    with socket.socket() as sock:
        return sock.connect_ex(("127.0.0.1", port)) == 0


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
def test_systemd_takes_the_unit(tmp_path: Path) -> None:
    unit = tmp_path / "siloscope.service"
    unit.write_text((DEPLOY / "siloscope.service").read_text().replace("/opt/siloscope/bin/siloscope", "/bin/true"))
    done = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False)
    assert "siloscope.service" not in done.stderr, done.stderr
