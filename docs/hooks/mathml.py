"""Equations become MathML while the site is built, so that the pages need no script and no network."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)
_TAG = re.compile(r"\\tag\{(.*?)\}")


def on_page_content(content: str, **_: Any) -> str:
    """Called by mkdocs with each page's HTML."""
    return _INLINE.sub(lambda found: _mathml(found[1], "inline"), _BLOCK.sub(_equation, content))


def _equation(found: re.Match[str]) -> str:
    """A displayed equation, with its number at the right margin."""
    tag = _TAG.search(found[1])
    number = f'<span class="number">({tag[1]})</span>' if tag else ""
    return f'<div class="equation">{_mathml(_TAG.sub("", found[1]), "block")}{number}</div>'


def _mathml(latex: str, display: str) -> str:
    return convert(html.unescape(latex).strip(), display=display)
