"""What becomes of an answer whose inputs contradict each other: refused, or remarked on where the caller trusts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from siloscope.errors import UsageError
from siloscope.reasons import sentence
from siloscope.types.estimate import Estimate
from siloscope.types.remark import Remark

TRUSTED = {
    "range": "outside-sensor-range",
    "camera": "intrinsics-contradicted",
    "bias": "depth-bias-contradicted",
    "diameter": "diameter-contradicted",
    "gravity": "gravity-contradicts",
}
"""What a caller can trust against a contradiction, and the code that then only warns."""


def trusted(names: str | Sequence[str]) -> frozenset[str]:
    """The codes that only warn, by the names of `TRUSTED` or as they are; raises `UsageError` for others."""
    chosen = (names,) if isinstance(names, str) else tuple(names)
    for name in chosen:
        if name not in TRUSTED and name not in TRUSTED.values():
            raise UsageError(f"trust '{name}' is not known; known are {', '.join(TRUSTED)}")
    return frozenset(TRUSTED.get(name, name) for name in chosen)


def judged(estimate: Estimate, found: Sequence[Remark], trust: frozenset[str]) -> Estimate:
    """The estimate with its remarks; refused where one refuses that is not trusted."""
    if estimate.ok:
        against = refused(estimate.method, found, trust, estimate.config)
        return against or replace(estimate, quality=weighed(found, trust))
    warned = [sentence((remark.text, remark.advice)) for remark in found if remark.severity == "warning"]
    return replace(estimate, quality=weighed(found, trust), message=" ".join([str(estimate.message), *warned]))


def refused(method: str, found: Sequence[Remark], trust: frozenset[str], config: dict[str, Any]) -> Estimate | None:
    """An estimate without an answer because of a remark that is not trusted; None where there is none."""
    told = weighed(found, trust)
    against = next((remark for remark in told if remark.refuses), None)
    if against is None:
        return None
    message = sentence((against.text, against.advice))
    return Estimate("refused", method, reason=against.code, message=message, config=config, quality=told)


def weighed(found: Sequence[Remark], trust: frozenset[str]) -> tuple[Remark, ...]:
    """The remarks, of which those that are trusted only warn."""
    return tuple(replace(remark, refuses=remark.refuses and remark.code not in trust) for remark in found)
