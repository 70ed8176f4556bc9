"""Ways out of the service as SITE.toml names them. What is not named is off; secrets lie in files beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from siloscope.errors import InputError
from siloscope.schema.fields import Number
from siloscope.schema.validation import StrictDocument, wrong

Port = Annotated[int, Field(ge=0, le=65_535)]

PAGE, MAIL, MQTT = "page", "mail", "mqtt"
"""Names of channels that a rule may have; a webhook's is its id. The page shows every alert."""

LARGEST_SECRET = 4096
"""Bytes."""


def _address(value: str) -> str:
    if not value.startswith(("http://", "https://")):
        raise wrong(f"must be an address that begins with https:// or http://, not {value[:40]!r}")
    return value


Address = Annotated[str, AfterValidator(_address)]


def _one_topic_level(value: Any) -> Any:
    if isinstance(value, str) and (not value or set(value) & set("/+#$ ")):
        raise wrong("must be one level of a topic, without '/', '+', '#', '$' and spaces")
    return value


class MqttEntry(StrictDocument):
    """``[mqtt]``."""

    host: str
    port: Port | None = None
    """1883, with TLS 8883."""
    box: Annotated[str | None, BeforeValidator(_one_topic_level)] = None
    """Names this installation in topics; the end of its id unless given."""
    username: str | None = None
    password_file: str | None = None
    tls: bool = False
    ca_file: str | None = None
    """Certificates that the broker's is checked by, in place of the machine's."""
    cert_file: str | None = None
    """The client's own certificate, and its key."""
    key_file: str | None = None
    discovery: Literal["device", "entity", "off"] = "device"
    """How Home Assistant is told: a message a silo (2024.11 and later), a message an entity, or not at all."""
    prefix: str = "homeassistant"
    """Of the topics that Home Assistant looks at."""


class ModbusEntry(StrictDocument):
    """``[modbus]``."""

    host: str = "127.0.0.1"
    port: Port = 502
    volume_scale: Number = 1.0
    """Factor on the volume in per cent of register 6: the manual of the 5708 can be read as 1 or 1000."""
    mass_unit: Literal["kg", "t", "lb"] = "kg"
    """Of register 20."""


class MailEntry(StrictDocument):
    """``[mail]``."""

    host: str
    port: Port | None = None
    """587, for `security = "tls"` 465, for "none" 25."""
    security: Literal["starttls", "tls", "none"] = "starttls"
    username: str | None = None
    password_file: str | None = None
    sender: str
    to: Annotated[list[str], Field(min_length=1)]


class WebhookEntry(StrictDocument):
    """``[[webhook]]``."""

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,39}$")]
    """Its name in a rule's channels."""
    url: Address
    secret_file: str
    """What requests are signed with."""
    allow_private: bool = False
    """Whether it may lead to this machine or into the local network."""


class EdgeEntry(StrictDocument):
    """``[edge]``: how this box serves its hub."""

    token_file: str
    """A token of the role edge, made at the hub."""
    ca_file: str | None = None
    frames: Literal["none", "samples", "all"] = "samples"
    """Which frames' bytes go up; samples are those that were refused and the first of a day and silo."""
    backlog_per_s: Number = 20.0
    """Readings a second of what the hub missed, beside the new ones."""


class Outlets(StrictDocument):
    """The entries of SITE.toml that lead out."""

    mqtt: MqttEntry | None = None
    modbus: ModbusEntry | None = None
    mail: MailEntry | None = None
    webhook: list[WebhookEntry] = Field(default_factory=list)
    hub: Address | None = None
    """Address of the hub; with it this box is an edge."""
    edge: EdgeEntry | None = None

    @property
    def channels(self) -> set[str]:
        """What rules may name."""
        named = {MAIL: self.mail, MQTT: self.mqtt}
        return {PAGE, *(hook.id for hook in self.webhook), *(name for name, entry in named.items() if entry)}


def secret(site: Path, name: str | None) -> str | None:
    """The first line of a file beside SITE.toml; raises `InputError` where there is none."""
    if name is None:
        return None
    path = site.parent / name
    try:
        with path.open("rb") as file:
            line = file.read(LARGEST_SECRET).decode().partition("\n")[0].strip()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: can't be read as a secret ({error}); put the secret into its first line") from None
    if not line:
        raise InputError(f"{path}: is empty; put the secret into its first line")
    return line
