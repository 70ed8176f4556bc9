"""OpenCV's FileStorage, as YAML or XML, as plain named fields."""

from __future__ import annotations

import re
import xml.etree.ElementTree as Xml
from typing import Any

from siloscope.errors import InputError

_MATRIX_TAG = "tag:yaml.org,2002:opencv-matrix"


def is_file_storage(text: str) -> bool:
    """Whether a text is written by OpenCV's FileStorage."""
    start = text.lstrip()
    return start.startswith("%YAML") or "!!opencv-matrix" in text or start.startswith(("<?xml", "<opencv_storage"))


def fields_of(name: str, text: str) -> dict[str, Any]:
    """The fields of a FileStorage; raises `InputError` where it is damaged."""
    try:
        fields = _from_xml(text) if text.lstrip().startswith("<") else _from_yaml(text)
    except (ValueError, TypeError, LookupError, RecursionError) as error:
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{name}: damaged OpenCV file ({cause}); write the calibration again") from None
    if not isinstance(fields, dict):
        raise InputError(f"{name}: no named fields; an OpenCV calibration has a camera_matrix")
    return fields


def _from_yaml(text: str) -> Any:
    import yaml

    loader: Any = type("Loader", (yaml.SafeLoader,), {})
    loader.add_constructor(_MATRIX_TAG, lambda made, node: made.construct_mapping(node, deep=True))
    plain = re.sub(r"^%YAML.*$", "", text, count=1, flags=re.MULTILINE)
    try:
        return next(iter(yaml.load_all(plain, loader)), None)
    except yaml.YAMLError as error:
        raise ValueError(error) from None


def _from_xml(text: str) -> Any:
    if "<!" in text.replace("<!--", ""):
        raise ValueError("it declares entities, which OpenCV does not")
    try:
        root = Xml.fromstring(text)
    except Xml.ParseError as error:
        raise ValueError(error) from None
    if root.tag != "opencv_storage":
        raise ValueError(f"its root is '{root.tag}', not 'opencv_storage'")
    return {child.tag: _value(child) for child in root}


def _value(element: Xml.Element) -> Any:
    """A number list for a matrix's data, fields for what has children, else the text."""
    if element.tag == "data":
        return (element.text or "").split()
    if len(element):
        return {child.tag: _value(child) for child in element}
    return (element.text or "").strip().strip('"')
