"""Writes the page's types from the service's OpenAPI document; with --check says whether they still agree."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

TARGET = Path(__file__).parents[1] / "web" / "src" / "data" / "types.ts"

HEAD = "/** What the service answers. Written by `make page-types` from its OpenAPI document: don't edit it here. */\n"

SCALARS = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}


def type_of(schema: dict[str, Any]) -> str:
    """A JSON schema as a TypeScript type."""
    if "$ref" in schema:
        return name_of(schema["$ref"].rsplit("/", 1)[1])
    if "const" in schema:
        return f'"{schema["const"]}"'
    if "enum" in schema:
        return " | ".join(f'"{value}"' for value in schema["enum"])
    for several in ("anyOf", "oneOf"):
        if several in schema:
            return " | ".join(dict.fromkeys(type_of(one) for one in schema[several]))
    if schema.get("type") == "array":
        inner = type_of(schema.get("items", {}))
        return f"({inner})[]" if " " in inner else f"{inner}[]"
    if schema.get("type") == "object":
        values = schema.get("additionalProperties")
        return f"Record<string, {type_of(values) if isinstance(values, dict) else 'unknown'}>"
    return SCALARS.get(schema.get("type", ""), "unknown")


def name_of(name: str) -> str:
    """A schema's name as one word: `Page_Silo_` becomes `PageSilo`."""
    return "".join(part[:1].upper() + part[1:] for part in name.replace("-", "_").split("_"))


def declaration(name: str, schema: dict[str, Any], *, sent: bool) -> str:
    """One schema as an interface, or as a type where it has no fields of its own.

    An answer always carries all its fields; of what is sent (`sent`) the optional ones may be left out.
    """
    about = schema.get("description", "").splitlines()
    head = f"/** {about[0]} */\n" if about and about[0] else ""
    if "properties" not in schema:
        return f"{head}export type {name_of(name)} = {type_of(schema)};\n"
    lines = []
    for field, one in schema["properties"].items():
        if "description" in one:
            lines.append(f"  /** {' '.join(one['description'].split())} */\n")
        optional = "?" if sent and field not in schema.get("required", []) else ""
        lines.append(f"  {field}{optional}: {type_of(one)};\n")
    return f"{head}export interface {name_of(name)} {{\n{''.join(lines)}}}\n"


def is_told(schema: dict[str, Any]) -> bool:
    """Whether there is anything in it."""
    return schema.get("type") != "object" or "properties" in schema


def sent_names(document: dict[str, Any]) -> set[str]:
    """Schemas of what requests carry."""
    bodies = [
        operation["requestBody"]
        for path in document["paths"].values()
        for operation in path.values()
        if "requestBody" in operation
    ]
    return set(re.findall(r"#/components/schemas/([\w-]+)", json.dumps(bodies)))


def text_of(document: dict[str, Any]) -> str:
    """The whole file."""
    schemas = document["components"]["schemas"]
    sent = sent_names(document)
    told = [name for name in sorted(schemas) if is_told(schemas[name])]
    return HEAD + "".join("\n" + declaration(name, schemas[name], sent=name in sent) for name in told)


def document() -> dict[str, Any]:
    """The OpenAPI document of a service that never runs."""
    from siloscope.monitor.api.app import create_app
    from siloscope.monitor.service import Service
    from siloscope.monitor.settings import Settings

    with TemporaryDirectory() as folder:
        service = Service(Settings(Path(folder)))
        found: dict[str, Any] = create_app(service).openapi()
        service.store.close()
    return found


def main() -> None:
    """Writes or compares."""
    made = text_of(document())
    if "--check" not in sys.argv:
        TARGET.write_text(made, encoding="utf-8")
    elif TARGET.read_text(encoding="utf-8") != made:
        sys.exit(f"{TARGET.name} differs from the service's OpenAPI document: run `make page-types`")


if __name__ == "__main__":
    main()
