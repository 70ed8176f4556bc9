"""The publishers that SITE.toml names, made parts of a service."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from siloscope.errors import InputError, UsageError
from siloscope.monitor.edge import linked
from siloscope.monitor.outbox import Channel, Deliverer
from siloscope.monitor.outlets import EdgeEntry, secret
from siloscope.monitor.service import Service


def attach(service: Service) -> None:
    """Adds them; they start and stop with the service.

    Raises
    ------
    InputError
        Where a file with a secret or a certificate can't be used, or the extra of a publisher is not installed.
    UsageError
        Where an address can't be listened on.
    """
    outlets, site = service.outlets, service.settings.site
    if site is None:
        return
    if outlets.hub is not None:
        _link(service, outlets.hub, outlets.edge, site)
    if outlets.modbus is not None:
        service.parts.append(_module("modbus").Modbus(service, outlets.modbus))
    if outlets.mqtt is not None:
        mqtt = _module("mqtt").Mqtt(service, outlets.mqtt, site)
        service.parts.append(mqtt)
        _deliver(service, mqtt)
    if outlets.mail is not None:
        _deliver(service, _module("mail").Mail(service.store, outlets.mail, secret(site, outlets.mail.password_file)))
    for hook in outlets.webhook:
        _deliver(
            service,
            _module("webhook").Webhook(service.store, service.clock, hook, secret(site, hook.secret_file)),
        )


def _link(service: Service, address: str, entry: EdgeEntry | None, site: Path) -> None:
    if entry is None:
        raise InputError(f"{site}: 'hub' needs an [edge] table with the token_file that the hub knows this box by")
    if not service.store.is_sqlite:
        raise UsageError("an edge box keeps its data in SQLite; leave --database out, or leave 'hub' out of SITE.toml")
    token = secret(site, entry.token_file)
    service.parts.append(linked(service, address, token or "", entry, site))


def _deliver(service: Service, channel: Channel) -> None:
    service.outbox.channels[channel.name] = channel
    service.parts.append(Deliverer(service.outbox, channel, service.clock, lambda: service.leads))


def _module(name: str) -> Any:
    """A publisher's module, loaded with its first use."""
    try:
        return import_module(f"siloscope.monitor.publish.{name}")
    except ImportError as error:
        raise InputError(f"[{name}] needs {error.name}; pip install 'siloscope[monitor]'") from None
