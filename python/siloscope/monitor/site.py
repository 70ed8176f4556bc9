"""SITE.toml: places, silos, cameras, products and rules as people write them down; applied at every start.

What the file names is set; what it doesn't name stays as it is.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from sqlalchemy import Connection

from siloscope.errors import InputError
from siloscope.monitor import rules
from siloscope.monitor.clock import zone
from siloscope.monitor.outlets import Outlets
from siloscope.monitor.store import alerts, places
from siloscope.schema import files
from siloscope.schema.fields import Index, NotNegative, Number
from siloscope.schema.validation import StrictDocument, validated, wrong

LARGEST_FILE = 4_000_000
"""Bytes."""

REMEDY = "docs/monitor/operator.md has an example"

LENGTHS = ("diameter", "cylinder", "cone", "bottom", "top", "outlet_diameter", "outlet_length")
"""Settings of `siloscope.measure` that a silo's table may have."""

STALE_S = 7200
"""A reading older than that is stale, unless a silo says otherwise, s."""


def slug(value: str) -> str:
    """Checks an id: what can stand in an address, a topic and a file name."""
    if (
        not 1 <= len(value) <= 80
        or not all(c.isascii() and (c.isalnum() or c in "-_.") for c in value)
        or value[0] == "."
    ):
        raise wrong(f"must be 1 to 80 letters, digits, '-', '_' or '.', not {value[:40]!r}")
    return value


Slug = Annotated[str, AfterValidator(slug)]


def _zone(value: str) -> str:
    try:
        return zone(value)
    except ValueError as error:
        raise wrong(str(error)) from None


Zone = Annotated[str, AfterValidator(_zone)]


class PlaceEntry(StrictDocument):
    """``[[place]]``."""

    id: Slug
    parent: Slug | None = None
    kind: Literal["mill", "customer", "farm", "barn", "site"] = "site"
    name: str | None = None
    zone: Zone | None = None


class SiloEntry(StrictDocument):
    """``[[silo]]``."""

    id: Slug
    place: Slug | None = None
    name: str | None = None
    product: str | None = None
    """Id of a product here, or the name of one of the built-in table."""
    vessel: str | None = None
    """A vessel file beside SITE.toml."""
    calibration: str | None = None
    """A calibration file beside SITE.toml."""
    diameter: Number | None = None
    cylinder: Number | None = None
    cone: Number | None = None
    bottom: Literal["cone", "flat", "unknown"] | None = None
    top: Number | None = None
    outlet_diameter: NotNegative | None = None
    outlet_length: NotNegative | None = None
    stale_after_s: Index | None = None
    modbus_unit: Annotated[int, Field(ge=1, le=247)] | None = None
    serial: Index | None = None
    banner: str | None = None


class CameraEntry(StrictDocument):
    """``[[camera]]``."""

    id: Slug
    silo: Slug
    intrinsics: str | None = None
    """A camera file beside SITE.toml."""
    sensor: str | None = None
    depth_unit: Number | None = None
    expected_s: Index | None = None
    """Seconds between frames."""
    live: str | None = None
    """Where the service takes its frames itself; see `siloscope.monitor.live.attach`."""


class ProductEntry(StrictDocument):
    """``[[product]]``."""

    id: Slug
    name: str | None = None
    density: Number
    density_std: NotNegative = 0.0


class RuleEntry(StrictDocument):
    """``[[rule]]``."""

    id: Slug
    kind: Literal[rules.KINDS]  # type: ignore[valid-type]
    place: Slug | None = None
    silo: Slug | None = None
    level: Number | None = None
    clear: Number | None = None
    delay_s: Index | None = None
    channels: list[str] = Field(default_factory=list)
    enabled: bool = True


class SiteEntry(StrictDocument):
    """``[site]``."""

    name: str | None = None
    zone: Zone | None = None


class SiteFile(Outlets):
    """The whole file."""

    site: SiteEntry = Field(default_factory=SiteEntry)
    place: list[PlaceEntry] = Field(default_factory=list)
    silo: list[SiloEntry] = Field(default_factory=list)
    camera: list[CameraEntry] = Field(default_factory=list)
    product: list[ProductEntry] = Field(default_factory=list)
    rule: list[RuleEntry] = Field(default_factory=list)

    def live(self, folder: Path) -> dict[str, tuple[str, Path]]:
        """Sources of the cameras that the service drives, whose paths begin at `folder`."""
        return {entry.id: (entry.live, folder.absolute()) for entry in self.camera if entry.live is not None}


def read(path: Path) -> SiteFile:
    """The file, checked; raises `InputError` naming the entry."""
    content = files.content(path, LARGEST_FILE, "a site", "give a TOML file with silos and cameras")
    return validated(SiteFile, files.from_toml(content, str(path), "site", REMEDY), str(path), REMEDY)


def apply(connection: Connection, found: SiteFile, path: Path, now: int) -> None:
    """Sets in the store what the file names, all or nothing.

    Raises
    ------
    InputError
        Where an entry names what is not there, or a file beside it can't be used.
    """
    _Applied(connection, path, now).all(found)


class _Applied:
    """One application of a file."""

    def __init__(self, connection: Connection, path: Path, now: int) -> None:
        self._connection, self._path, self._now = connection, path, now

    def all(self, found: SiteFile) -> None:
        for key, value in found.site.model_dump(exclude_none=True).items():
            places.set_fact(self._connection, key, value)
        for place in found.place:
            self._place(place)
        for product in found.product:
            self._product(product)
        for silo in found.silo:
            self._silo(silo)
        for camera in found.camera:
            self._camera(camera)
        for silo in found.silo:
            self._calibration(silo)
        for rule in found.rule:
            self._rule(rule, found.channels)

    def _place(self, told: PlaceEntry) -> None:
        self._must_be("place", told.parent, f"place '{told.id}'")
        values = {"kind": told.kind, "name": told.name or told.id}
        values |= _given(told, "parent", "zone")
        places.put(self._connection, "place", told.id, values, self._now)

    def _product(self, told: ProductEntry) -> None:
        document = {"name": told.name or told.id, "loose": told.density, "std": told.density_std}
        self._put_product(told.id, document)

    def _put_product(self, key: str, document: dict[str, Any]) -> None:
        values = {"name": document["name"], "density": document["loose"], "density_std": document["std"]}
        places.put(self._connection, "product", key, {**values, "document": document}, self._now)

    def _silo(self, told: SiloEntry) -> None:
        self._must_be("place", told.place, f"silo '{told.id}'")
        before = places.get(self._connection, "silo", told.id)
        vessel = {} if before is None else dict(before.vessel)
        vessel |= _given(told, *LENGTHS)
        if told.vessel is not None:
            vessel["vessel"] = str(self._beside(told.vessel).absolute())
        values: dict[str, Any] = {"vessel": vessel} | _given(
            told, "place", "modbus_unit", "serial", "banner", "stale_after_s"
        )
        if before is None:
            values = {"name": told.id, "stale_after_s": STALE_S} | values
        values |= _given(told, "name")
        if told.product is not None:
            values["product"] = self._known_product(told.product, told.id)
        places.put(self._connection, "silo", told.id, values, self._now)
        if told.product is not None:
            places.fill(self._connection, told.id, told.product, self._now)

    def _known_product(self, key: str, silo: str) -> str:
        if places.get(self._connection, "product", key) is None:
            self._put_product(key, built_in(key, f"{self._path}: silo '{silo}'"))
        return key

    def _camera(self, told: CameraEntry) -> None:
        self._must_be("silo", told.silo, f"camera '{told.id}'")
        values: dict[str, Any] = {"silo": told.silo} | _given(told, "sensor", "depth_unit", "expected_s")
        if told.intrinsics is not None:
            values["intrinsics"] = camera_text(self._beside(told.intrinsics))
        places.put(self._connection, "camera", told.id, values, self._now)

    def _calibration(self, told: SiloEntry) -> None:
        if told.calibration is None:
            return
        document = calibration_document(self._beside(told.calibration))
        for camera in places.listed(self._connection, "camera"):
            if camera.silo == told.id:
                row = {"origin": "site", "state": places.CONFIRMED, "valid_from": 0, "confirmed_by": "SITE.toml"}
                frames = len(document.get("frames", ()))
                places.add_calibration(self._connection, told.id, camera.id, document, self._now, frames=frames, **row)

    def _rule(self, told: RuleEntry, channels: set[str]) -> None:
        self._must_be("place", told.place, f"rule '{told.id}'")
        self._must_be("silo", told.silo, f"rule '{told.id}'")
        for channel in told.channels:
            if channel not in channels:
                raise InputError(
                    f"{self._path}: rule '{told.id}' names the channel '{channel}', which is not there; "
                    f"known are {', '.join(sorted(channels))}"
                )
        defaults = rules.DEFAULTS[told.kind]
        level = defaults.level if told.level is None else told.level
        values = {
            "place": told.place,
            "silo": told.silo,
            "kind": told.kind,
            "level": level,
            "clear": (defaults.clear if told.level is None else rules.clear_of(told.kind, level))
            if told.clear is None
            else told.clear,
            "delay_s": defaults.delay_s if told.delay_s is None else told.delay_s,
            "channels": told.channels,
            "enabled": told.enabled,
        }
        alerts.put_rule(self._connection, told.id, values, self._now)

    def _must_be(self, kind: str, key: str | None, who: str) -> None:
        if key is not None and places.get(self._connection, kind, key) is None:
            raise InputError(
                f"{self._path}: {who} names the {kind} '{key}', which is not there; add a [[{kind}]] before it"
            )

    def _beside(self, name: str) -> Path:
        return self._path.parent / name


def _given(told: StrictDocument, *names: str) -> dict[str, Any]:
    return {name: value for name in names if (value := getattr(told, name)) is not None}


def built_in(key: str, who: str) -> dict[str, Any]:
    """A product of the library's table as a document; raises `InputError` where there is none of this name."""
    from dataclasses import asdict

    from siloscope.content.density import products

    table = products()
    if key not in table:
        raise InputError(
            f"{who} names the product '{key}', which is not there; "
            f"add a [[product]], or name one of {', '.join(sorted(table))}"
        )
    return asdict(table[key])


def camera_text(path: Path) -> str:
    """The text of a camera file that can be read."""
    from siloscope.io import camera_files

    camera_files.read(path)
    return camera_files.text_of(path)


def calibration_document(path: Path) -> dict[str, Any]:
    """The document of a calibration file that can be used."""
    from siloscope.types.calibration import Calibration

    calibration = Calibration.load(path)
    if not calibration.ok:
        raise InputError(f"{path}: the calibration was refused ({calibration.reason}); calibrate with more frames")
    found: dict[str, Any] = files.from_json(
        path.read_bytes(), str(path), "take the file as `siloscope calibrate` wrote it"
    )
    return found
