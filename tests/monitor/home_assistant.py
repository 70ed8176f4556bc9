"""What Home Assistant takes of a discovery message, by its own source.

The source is `components/mqtt/schemas.py`, `sensor.py`, `binary_sensor.py`, `discovery.py` and
`components/sensor/const.py` of 2025.4. Entries that it would drop in silence are refused here.
"""

from __future__ import annotations

import re
from typing import Any

TOPIC = re.compile(r"(?P<prefix>\w+)/(?P<component>\w+)/((?P<node>[a-zA-Z0-9_-]+)/)?(?P<object>[a-zA-Z0-9_-]+)/config")

DEVICE = {
    *("identifiers", "connections", "manufacturer", "model", "model_id", "name", "hw_version", "serial_number"),
    *("sw_version", "via_device", "suggested_area", "configuration_url"),
}
ORIGIN = {"name", "sw_version", "support_url"}
SHARED = {
    *("availability", "availability_mode", "availability_template", "availability_topic", "command_topic"),
    *("payload_available", "payload_not_available", "state_topic", "qos", "encoding"),
}
ENTITY = {
    *("name", "device_class", "entity_category", "icon", "unique_id", "value_template", "expire_after"),
    *("enabled_by_default", "json_attributes_topic", "json_attributes_template", "object_id", "force_update"),
}
PLATFORMS = {
    "sensor": ENTITY
    | {"unit_of_measurement", "state_class", "suggested_display_precision", "last_reset_value_template"},
    "binary_sensor": ENTITY | {"payload_on", "payload_off", "off_delay"},
}
UNITS: dict[str, set[str | None]] = {
    "volume_storage": {"m³", "L"},
    "weight": {"kg", "t"},
    "distance": {"m", "mm"},
    "timestamp": {None},
}
CLASSES: dict[str, set[str | None]] = {"sensor": {*UNITS, None}, "binary_sensor": {"problem", "connectivity"}}
STATE_CLASSES: dict[str, set[str | None]] = {
    "volume_storage": {"measurement", None},
    "weight": {"measurement", None},
    "distance": {"measurement", None},
    "timestamp": {None},
}


def faults(topic: str, message: dict[str, Any]) -> list[str]:
    """What is wrong with a discovery message."""
    found = TOPIC.fullmatch(topic)
    if found is None:
        return [f"{topic} is no discovery topic"]
    common = _common(message)
    component = found["component"]
    if component == "device":
        if not message.get("components"):
            return [*common, "a device message needs components"]
        common += _unknown(message, {"device", "components", "origin"} | SHARED, "the message")
        for key, entity in message["components"].items():
            merged = {name: message[name] for name in SHARED if name in message} | entity
            common += _entity(f"{key}: ", merged.pop("platform", None), merged)
        return common
    entity = {name: value for name, value in message.items() if name not in ("device", "origin")}
    return common + _entity("", component, entity)


def _common(message: dict[str, Any]) -> list[str]:
    device, origin = message.get("device"), message.get("origin")
    made = []
    if not device or not (device.get("identifiers") or device.get("connections")):
        made.append("the device needs an identifier")
    if not origin or not origin.get("name"):
        made.append("the origin needs a name")
    return made + _unknown(device or {}, DEVICE, "the device") + _unknown(origin or {}, ORIGIN, "the origin")


def _entity(where: str, platform: str | None, entity: dict[str, Any]) -> list[str]:
    if platform not in PLATFORMS:
        return [f"{where}platform {platform}"]
    made = _unknown(entity, PLATFORMS[platform] | SHARED, where)
    kind, unit = entity.get("device_class"), entity.get("unit_of_measurement")
    if kind not in CLASSES[platform]:
        made.append(f"{where}device_class {kind}")
    if kind in UNITS and unit not in UNITS[kind]:
        made.append(f"{where}unit {unit}")
    if kind in STATE_CLASSES and entity.get("state_class") not in STATE_CLASSES[kind]:
        made.append(f"{where}state_class {entity.get('state_class')}")
    if not _is_topic(entity.get("state_topic")):
        made.append(f"{where}state_topic {entity.get('state_topic')}")
    if "unique_id" not in entity:
        made.append(f"{where}has no unique_id, so it is in no device")
    if "availability" in entity and "availability_topic" in entity:
        made.append(f"{where}availability twice")
    if entity.get("availability_mode", "latest") not in ("all", "any", "latest"):
        made.append(f"{where}availability_mode")
    for one in entity.get("availability", ()):
        made += _unknown(one, {"topic", "payload_available", "payload_not_available", "value_template"}, where)
        made += [] if _is_topic(one.get("topic")) else [f"{where}availability topic"]
    expire = entity.get("expire_after", 0)
    return made + ([] if isinstance(expire, int) and expire >= 0 else [f"{where}expire_after"])


def _is_topic(value: Any) -> bool:
    return isinstance(value, str) and 0 < len(value) < 65_536 and not set(value) & set("\0#+")


def _unknown(told: dict[str, Any], known: set[str], where: str) -> list[str]:
    return [f"{where}: unknown entry {name}" for name in told.keys() - known]
