"""What Home Assistant is told over MQTT, so that every silo becomes a device with its entities.

The messages follow its schema of device discovery (Home Assistant 2024.11 and later: `homeassistant/components/mqtt/
schemas.py`), or of discovery by entity for older ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from siloscope import _core
from siloscope.monitor.publish.image import Image

Document = dict[str, Any]

ONLINE, OFFLINE = "online", "offline"

ORIGIN = {"name": "siloscope", "sw_version": _core.__version__}

_MEASUREMENT = {"state_class": "measurement"}
_DIAGNOSTIC = {"entity_category": "diagnostic"}

SENSORS: dict[str, Document] = {
    "volume": {
        "name": "Volume",
        "device_class": "volume_storage",
        "unit_of_measurement": "m³",
        "value_template": "{{ value_json.volume_m3 }}",
        "suggested_display_precision": 2,
        **_MEASUREMENT,
    },
    "volume_std": {
        "name": "Volume deviation",
        "unit_of_measurement": "m³",
        "value_template": "{{ value_json.volume_std_m3 }}",
        "suggested_display_precision": 2,
        **_MEASUREMENT,
        **_DIAGNOSTIC,
    },
    "mass": {
        "name": "Mass",
        "device_class": "weight",
        "unit_of_measurement": "kg",
        "value_template": "{{ value_json.mass_kg }}",
        "suggested_display_precision": 0,
        **_MEASUREMENT,
    },
    "fill": {
        "name": "Fill",
        "unit_of_measurement": "%",
        "icon": "mdi:silo",
        "value_template": "{{ value_json.fill_percent }}",
        "suggested_display_precision": 1,
        **_MEASUREMENT,
    },
    "level": {
        "name": "Level",
        "device_class": "distance",
        "unit_of_measurement": "m",
        "value_template": "{{ value_json.level_m }}",
        "suggested_display_precision": 2,
        **_MEASUREMENT,
    },
    "empty_by": {
        "name": "Empty by",
        "device_class": "timestamp",
        "value_template": "{{ value_json.empty_by }}",
    },
    "measured": {
        "name": "Measured",
        "device_class": "timestamp",
        "value_template": "{{ value_json.time }}",
        **_DIAGNOSTIC,
    },
}
"""By key; the key is the end of the unique id, so it never changes."""

PROBLEM: Document = {
    "name": "Problem",
    "device_class": "problem",
    "value_template": "{{ value_json.problem }}",
    "payload_on": "ON",
    "payload_off": "OFF",
}


@dataclass(frozen=True)
class Topics:
    """Of one installation."""

    box: str
    prefix: str

    @property
    def box_status(self) -> str:
        """Whether the service is there: its last will says "offline"."""
        return f"siloscope/{self.box}/status"

    @property
    def birth(self) -> str:
        """Where Home Assistant says that it has started."""
        return f"{self.prefix}/status"

    def of(self, silo: str, what: str) -> str:
        """`status`, `state` or `event` of a silo."""
        return f"siloscope/{self.box}/{silo}/{what}"

    def config(self, component: str, *parts: str) -> str:
        """A discovery topic; its parts may have letters, digits, '_' and '-' only."""
        return "/".join((self.prefix, component, *(part.replace(".", "__") for part in parts), "config"))


def by_device(topics: Topics, found: list[Image]) -> dict[str, Document]:
    """A message for the box and one for each silo: topic and document."""
    made = {topics.config("device", topics.box): _box(topics)}
    for image in found:
        silo = image.silo.id
        entities = _entities(topics, image)
        made[topics.config("device", f"{topics.box}_{silo}")] = {
            "device": _device(topics, image),
            "origin": ORIGIN,
            "components": {key: {"platform": platform, **told} for key, (platform, told) in entities.items()},
            **_shared(topics, silo),
        }
    return made


def by_entity(topics: Topics, found: list[Image]) -> dict[str, Document]:
    """A message for each entity of each silo."""
    made = {}
    for image in found:
        silo = image.silo.id
        common = {"device": _device(topics, image), "origin": ORIGIN, **_shared(topics, silo)}
        for key, (platform, told) in _entities(topics, image).items():
            made[topics.config(platform, f"{topics.box}_{silo}", key)] = {**common, **told}
    return made


def _shared(topics: Topics, silo: str) -> Document:
    return {
        "state_topic": topics.of(silo, "state"),
        "availability": [{"topic": topics.box_status}, {"topic": topics.of(silo, "status")}],
        "availability_mode": "all",
        "qos": 1,
    }


def _device(topics: Topics, image: Image) -> Document:
    found = {
        "identifiers": [f"siloscope_{topics.box}_{image.silo.id}"],
        "name": image.silo.name,
        "manufacturer": "siloscope",
        "model": "Silo",
        "sw_version": _core.__version__,
        "via_device": f"siloscope_{topics.box}",
    }
    return found if image.place is None else {**found, "suggested_area": image.place}


def _entities(topics: Topics, image: Image) -> dict[str, tuple[str, Document]]:
    silo = image.silo
    own = {"expire_after": silo.stale_after_s}
    entities = {key: ("sensor", told) for key, told in SENSORS.items()} | {"problem": ("binary_sensor", PROBLEM)}
    return {
        key: (platform, {**told, **own, "unique_id": f"siloscope_{topics.box}_{silo.id}_{key}"})
        for key, (platform, told) in entities.items()
    }


def _box(topics: Topics) -> Document:
    """The device that the silos hang on."""
    link = {
        "platform": "binary_sensor",
        "name": "Service",
        "device_class": "connectivity",
        "entity_category": "diagnostic",
        "state_topic": topics.box_status,
        "payload_on": ONLINE,
        "payload_off": OFFLINE,
        "unique_id": f"siloscope_{topics.box}_service",
    }
    device = {
        "identifiers": [f"siloscope_{topics.box}"],
        "name": f"siloscope {topics.box}",
        "manufacturer": "siloscope",
        "model": "Box",
        "sw_version": _core.__version__,
    }
    return {"device": device, "origin": ORIGIN, "components": {"service": link}}
