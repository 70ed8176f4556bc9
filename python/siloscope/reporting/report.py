"""A report page: one HTML file with its pictures inside, that needs no network and reads on a phone."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template


@dataclass
class Report:
    """Parts of a page in the order in which they are read; the methods that add return the report."""

    title: str
    lead: str
    footer: str = ""
    parts: list[str] = field(default_factory=list)

    def cards(self, pairs: Sequence[tuple[str, str]]) -> Report:
        """Big numbers and what each says."""
        each = "".join(
            f'<div class="card"><b>{escape(value)}</b><span>{escape(name)}</span></div>' for value, name in pairs
        )
        self.parts.append(f'<div class="cards">{each}</div>')
        return self

    def section(self, title: str, *parts: str) -> Report:
        """A titled block of the HTML that `text`, `table`, `picture` and `command` give."""
        self.parts.append(f"<section><h2>{escape(title)}</h2>{''.join(parts)}</section>")
        return self

    def html(self) -> str:
        """The page."""
        template = Template(files(__package__).joinpath("report.html").read_text("utf-8"))
        return template.substitute(
            title=escape(self.title), lead=escape(self.lead), footer=escape(self.footer), body="\n".join(self.parts)
        )

    def write(self, path: Path) -> Path:
        """Writes the page."""
        path.write_text(self.html(), "utf-8", errors="replace")
        return path


def text(*paragraphs: str) -> str:
    """Paragraphs of plain text."""
    return "".join(f"<p>{escape(paragraph)}</p>" for paragraph in paragraphs)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; its first column is what the row is about."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def picture(png: bytes, caption: str, narrow: bool = False) -> str:
    """A picture inside the page; the caption is also its text for those who can't see it."""
    data = base64.b64encode(png).decode("ascii")
    shown = escape(caption)
    kind = ' class="narrow"' if narrow else ""
    return (
        f'<figure{kind}><img src="data:image/png;base64,{data}" alt="{shown}"><figcaption>{shown}</figcaption></figure>'
    )


def command(lines: str) -> str:
    """Something to type."""
    return f"<pre><code>{escape(lines)}</code></pre>"
