"""One server for all tests that leave it as it is for the others."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from monitor.servers import Server, serving, write_site


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with one calibrated silo and two cameras, without a user."""
    folder = tmp_path_factory.mktemp("shared")
    with serving(folder / "data", write_site(folder / "site", cameras=2)) as running:
        yield running
