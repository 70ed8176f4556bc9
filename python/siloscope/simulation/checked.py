"""The core's refusals as the package's errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from siloscope.errors import UsageError

Checked = TypeVar("Checked")


def checked(check: Callable[..., Checked], *arguments: Any) -> Checked:
    """Runs a core function; its refusal becomes a `UsageError`."""
    try:
        return check(*arguments)
    except (ValueError, TypeError, OverflowError) as error:
        raise UsageError(str(error)) from None
