"""The models' base, and the one translator from pydantic's errors to a sentence that names the entry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from siloscope.errors import InputError

Model = TypeVar("Model", bound=BaseModel)


class Document(BaseModel):
    """A document or a part of one; entries that are not known are left alone."""

    model_config = ConfigDict(strict=True, frozen=True, arbitrary_types_allowed=True)


class StrictDocument(Document):
    """A document that people write by hand: an entry that is not known is a mistake."""

    model_config = ConfigDict(extra="forbid")


def wrong(sentence: str, entry: str = "") -> PydanticCustomError:
    """What a check raises: `sentence` goes on after the entry's name; `entry` is the path below the model's own."""
    return PydanticCustomError("wrong", "{sentence}", {"sentence": sentence, "entry": entry})


def validated(model: type[Model], content: Any, source: str, remedy: str) -> Model:
    """The content of `source` as its model; raises `InputError` with source, entry, cause and remedy."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{source}: {_sentence(error.errors(include_url=False)[0], model)}; {remedy}") from None


def _sentence(error: ErrorDetails, model: type[BaseModel]) -> str:
    known = error.get("ctx", {})
    path = _path([*error["loc"], *([known["entry"]] if known.get("entry") else [])])
    value = str(error["input"])[:40]
    match error["type"]:
        case "wrong":
            return f"'{path}' {known['sentence']}" if path else str(known["sentence"])
        case "missing":
            return f"'{path}' is missing"
        case "model_type" | "model_attributes_type" | "dict_type":
            return f"'{path}' must be an object" if path else "it has no named entries"
        case "list_type":
            return f"'{path}' must be a list"
        case "string_type":
            return f"'{path}' must be a text"
        case "literal_error":
            expected = str(known["expected"]).replace("'", "").replace(" or ", ", ")
            return f"'{path}' is {value!r}; known are {expected}"
        case "extra_forbidden":
            return f"unknown entry '{path}'; known are {', '.join(sorted(_beside(model, error['loc'])))}"
        case _:
            return f"'{path}': {error['msg'][0].lower()}{error['msg'][1:]}"


def _path(parts: Sequence[int | str]) -> str:
    """``evidence.frames[3].rays``."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts).removeprefix(".")


def _beside(model: type[BaseModel], place: Sequence[int | str]) -> list[str]:
    """Names of the entries that a model knows where another one stands."""
    for part in place[:-1]:
        field = model.model_fields.get(str(part))
        inner = [kind for kind in _kinds(None if field is None else field.annotation) if issubclass(kind, BaseModel)]
        model = inner[0] if inner else model
    return list(model.model_fields)


def _kinds(annotation: Any) -> list[type]:
    if isinstance(annotation, type):
        return [annotation]
    return [kind for part in getattr(annotation, "__args__", ()) for kind in _kinds(part)]
