"""The text that ``rs-enumerate-devices -c`` prints."""

from __future__ import annotations

import re
from typing import Any

from siloscope.errors import InputError
from siloscope.io.camera_files.fields import from_fields, sized
from siloscope.types.camera import Camera


def from_enumeration(name: str, text: str) -> tuple[Camera, ...]:
    """The depth cameras of ``rs-enumerate-devices -c``, one a resolution, equal ones once."""
    blocks = re.split(r'^\s*Intrinsic of "', text, flags=re.MULTILINE)[1:]
    depth = [block for block in blocks if block.startswith("Depth")]
    if not depth:
        raise InputError(
            f"{name}: no intrinsics of a Depth stream; run rs-enumerate-devices -c with the camera connected"
        )
    return tuple(dict.fromkeys(_from_block(name, block) for block in depth))


def _from_block(name: str, block: str) -> Camera:
    pairs = re.findall(
        r"^[ \t]*(Width|Height|PPX|PPY|Fx|Fy|Distortion|Coeffs):[ \t]*(.*?)[ \t\r]*$", block, re.MULTILINE
    )
    words = {key.lower(): value for key, value in reversed(pairs)}
    fields: dict[str, Any] = {
        key: _parsed(words[key]) for key in ("width", "height", "ppx", "ppy", "fx", "fy") if key in words
    }
    fields |= {"model": words.get("distortion", ""), "coeffs": [_parsed(k) for k in words.get("coeffs", "").split()]}
    return sized(name, from_fields(name, fields).cameras[0])


def _parsed(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word
