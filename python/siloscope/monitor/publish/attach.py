"""The publishers that SITE.toml names, made parts of a service."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from siloscope.errors import InputError
from siloscope.monitor.outbox import Channel, Deliverer
from siloscope.monitor.outlets import secret
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


def _deliver(service: Service, channel: Channel) -> None:
    service.outbox.channels[channel.name] = channel
    service.parts.append(Deliverer(service.outbox, channel, service.clock))


def _module(name: str) -> Any:
    """A publisher's module, loaded with its first use."""
    try:
        return import_module(f"siloscope.monitor.publish.{name}")
    except ImportError as error:
        raise InputError(f"[{name}] needs {error.name}; pip install 'siloscope[monitor]'") from None
