"""Names of the distortion models, whoever named them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from siloscope.errors import InputError

DISTORTION_NAMES = {
    "none": "none",
    "pinhole": "none",
    "brown conrady": "brown_conrady",
    "plumb bob": "brown_conrady",
    "inverse brown conrady": "inverse_brown_conrady",
    "rational": "rational",
    "rational polynomial": "rational",
    "equidistant": "kannala_brandt",
    "kannala brandt": "kannala_brandt",
    "kannala brandt4": "kannala_brandt",
    "fisheye": "kannala_brandt",
}
"""What others call the distortion models (in lower case, words apart by one space) and what they are called here."""

_POLYNOMIALS = ("brown_conrady", "inverse_brown_conrady", "rational")
_ZERO_IS_PINHOLE = ("modified brown conrady",)


def distortion_model(name: str, model: str, coefficients: Sequence[float]) -> str:
    """Our name of a distortion model, whoever named it; unknown ones are refused by name.

    A polynomial whose coefficients are all 0 is none: many drivers name a model that they don't use.
    """
    words, zero = _words(model), not any(coefficients)
    if zero and (not words or words in _ZERO_IS_PINHOLE or DISTORTION_NAMES.get(words) in _POLYNOMIALS):
        return "none"
    if not words:
        raise InputError(f"{name}: distortion coefficients without a model; name it as 'distortion_model'")
    if words not in DISTORTION_NAMES:
        raise InputError(f"{name}: unknown distortion model '{model}'; known are {', '.join(sorted(DISTORTION_NAMES))}")
    known = DISTORTION_NAMES[words]
    if known == "none" and not zero:
        raise InputError(f"{name}: distortion model '{model}' has no coefficients, but the file gives some")
    return known


def is_fisheye(model: str) -> bool:
    """Whether a model, in anyone's spelling, is Kannala and Brandt's."""
    return DISTORTION_NAMES.get(_words(model)) == "kannala_brandt"


def _words(model: str) -> str:
    return re.sub(r"[\s_.\-]+", " ", model.strip().lower()).removeprefix("distortion ").strip()
