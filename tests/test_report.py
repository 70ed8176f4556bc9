"""The report page: one file, nothing to fetch, nothing injected."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

from siloscope.reporting import report

PNG = b"\x89PNG\r\n\x1a\n"


def page() -> str:
    made = report.Report("A <b>title</b> & $more", "What was done")
    made.cards([("0.2 mm", "error")])
    made.section("Part", report.text("one < two"), report.table(["a", "b"], [["1", "<script>"]]))
    made.section("Seen", report.picture(PNG, 'a "caption"'), report.command("siloscope locate a.png > b"))
    return made.html()


def test_page_is_well_formed_and_escapes_what_it_shows() -> None:
    class Balance(HTMLParser):
        void = frozenset({"meta", "img", "br", "link"})

        def __init__(self) -> None:
            super().__init__()
            self.open: list[str] = []

        def handle_starttag(self, tag: str, attrs: object) -> None:
            self.open += [] if tag in self.void else [tag]

        def handle_endtag(self, tag: str) -> None:
            assert self.open.pop() == tag

    balance = Balance()
    balance.feed(page())
    assert balance.open == []
    assert "<script>" not in page()
    assert "A &lt;b&gt;title" in page()


def test_page_fetches_nothing(tmp_path: Path) -> None:
    path = report.Report("t", "l").section("s", report.picture(PNG, "c")).write(tmp_path / "report.html")
    html = path.read_text("utf-8")
    assert not re.findall(r'(?:src|href)="(?!data:)', html)
    assert "http" not in html
    assert "url(" not in html
    assert 'name="viewport"' in html
