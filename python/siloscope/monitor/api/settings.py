"""Places, silos, cameras and products: what there is, and changing it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Path, Request, Response
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError

from siloscope.errors import InputError
from siloscope.monitor import access, site
from siloscope.monitor.access import Person
from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import PersonOf, Reading, ServiceOf, address_of, need, refusals
from siloscope.monitor.api.versions import IfMatch, must_match, tell
from siloscope.monitor.problems import Problem
from siloscope.monitor.service import Service
from siloscope.monitor.store import live, people, places

router = APIRouter(tags=["settings"])

Key = Annotated[str, Path(max_length=80, pattern=r"^[A-Za-z0-9_-][A-Za-z0-9_.-]*$")]

CHANGED = refusals("forbidden", "cross-origin", "not-found", "conflict", "changed-meanwhile", "precondition-required")


@dataclass(frozen=True)
class Change:
    """Who changes what."""

    kind: str
    key: str
    person: Person
    told: str | None
    """If-Match."""
    address: str


def _kept(service: Service, change: Change, values: dict[str, Any], fresh: dict[str, Any]) -> Any:
    """Writes a change and gives the row; `fresh` is what a new one has beside."""
    now = service.clock.now()
    try:
        with service.store.write() as connection:
            row = places.get(connection, change.kind, change.key)
            need("admin", change.person, _around(connection, change.kind, row, values))
            must_match(row, change.told, f"the {change.kind} '{change.key}'")
            _check(connection, change, values)
            places.put(connection, change.kind, change.key, values if row else fresh | values, now)
            if values.get("product") is not None:
                places.fill(connection, change.key, values["product"], now)
            log = {"detail": _loggable(values), "address": change.address}
            people.log(connection, now, change.person.name, f"set {change.kind}", change.key, **log)
            found = places.get(connection, change.kind, change.key)
    except IntegrityError:
        raise Problem("conflict", "another one has this already, or something that it needs is missing") from None
    service.announce()
    return found


def _loggable(values: dict[str, Any]) -> dict[str, Any]:
    return {name: value if not isinstance(value, str) else value[:200] for name, value in values.items()}


def _around(connection: Connection, kind: str, row: Any, values: dict[str, Any]) -> list[str]:
    """The places in which one must be an administrator; none for what belongs to the whole site."""
    match kind:
        case "place":
            return places.above(connection, values.get("parent") if row is None else row.parent)
        case "silo":
            return places.above(connection, values.get("place") if row is None else row.place)
        case "camera":
            silo = places.get(connection, "silo", values.get("silo") or (row.silo if row else ""))
            return access.around(connection, silo)
        case _:
            return []


def _check(connection: Connection, change: Change, values: dict[str, Any]) -> None:
    for name, kind in (("parent", "place"), ("place", "place"), ("silo", "silo"), ("product", "product")):
        key = values.get(name)
        if key is not None and places.get(connection, kind, key) is None:
            raise Problem("invalid", f"'{name}': there is no {kind} '{key}'")
        if key is not None and kind == "place" and name != "parent":
            need("admin", change.person, places.above(connection, key))
    if change.kind == "place" and change.key in places.above(connection, values.get("parent")):
        raise Problem("invalid", "'parent': a place can't lie in itself")


def _removed(service: Service, change: Change) -> Response:
    now = service.clock.now()
    with service.store.write() as connection:
        row = places.get(connection, change.kind, change.key)
        if row is None:
            raise Problem("not-found", f"there is no {change.kind} '{change.key}'")
        need("admin", change.person, _around(connection, change.kind, row, {}))
        must_match(row, change.told, f"the {change.kind} '{change.key}'")
        places.remove(connection, change.kind, change.key, now)
        people.log(connection, now, change.person.name, f"remove {change.kind}", change.key, address=change.address)
    service.announce()
    return Response(status_code=204)


def _given(body: Any) -> dict[str, Any]:
    """What is to change; an explicit null takes a value away."""
    found: dict[str, Any] = body.model_dump(exclude_unset=True)
    return found


def _not_null(values: dict[str, Any], *names: str) -> None:
    for name in names:
        if name in values and values[name] is None:
            raise Problem("invalid", f"'{name}' can't be null")


def _place(row: Any) -> models.Place:
    return models.Place(**{n: getattr(row, n) for n in ("id", "parent", "kind", "name", "zone", "version")})


def _product(row: Any) -> models.Product:
    amounts = {"density_kg_m3": row.density, "density_std_kg_m3": row.density_std}
    return models.Product(id=row.id, name=row.name, version=row.version, **amounts)


def _camera(connection: Connection, row: Any) -> models.Camera:
    told = {name: getattr(row, name) for name in ("id", "silo", "sensor", "depth_unit", "expected_s", "version")}
    state, driven = views.camera_state(connection, row), live.states(connection).get(row.id)
    told_live = None if driven is None else models.Live(**{**driven, "since": views.at(driven["since"])})
    return models.Camera(**told, has_intrinsics=bool(row.intrinsics), state=state, live=told_live)


@router.get("/places", response_model=models.Page[models.Place], responses=refusals())
def get_places(connection: Reading, person: PersonOf) -> models.Page[models.Place]:
    """The tree of places; those that may be seen and what they lie in."""
    rows = places.listed(connection, "place")
    seen = [row for row in rows if person.role_at(places.above(connection, row.id)) is not None]
    wanted = {key for row in seen for key in places.above(connection, row.id)}
    return models.Page(items=[_place(row) for row in rows if row.id in wanted])


@router.put("/places/{place}", response_model=models.Place, responses=CHANGED)
def put_place(
    place: Key,
    body: models.PlaceChange,
    person: PersonOf,
    service: ServiceOf,
    request: Request,
    response: Response,
    if_match: IfMatch = None,
) -> models.Place:
    """Makes or changes a place."""
    values = _given(body)
    _not_null(values, "kind", "name")
    change = Change("place", place, person, if_match, address_of(request))
    row = _kept(service, change, values, {"kind": "site", "name": place})
    tell(response, row)
    return _place(row)


@router.put("/silos/{silo}", response_model=models.Silo, responses=CHANGED)
def put_silo(
    silo: Key,
    body: models.SiloChange,
    person: PersonOf,
    service: ServiceOf,
    request: Request,
    response: Response,
    if_match: IfMatch = None,
) -> models.Silo:
    """Makes or changes a silo; what is left out stays."""
    values = _given(body)
    _not_null(values, "name", "stale_after_s")
    with service.store.read() as connection:
        before = places.get(connection, "silo", silo)
    if "vessel" in values:
        told = {} if values["vessel"] is None else {k: v for k, v in values["vessel"].items() if v is not None}
        file = {} if before is None else {k: v for k, v in before.vessel.items() if k == "vessel"}
        values["vessel"] = file | told
    fresh = {"name": silo, "vessel": {}, "stale_after_s": site.STALE_S}
    row = _kept(service, Change("silo", silo, person, if_match, address_of(request)), values, fresh)
    tell(response, row)
    with service.store.read() as connection:
        role = person.role_at(access.around(connection, row)) or "admin"
        return views.silo(connection, row, list(places.listed(connection, "camera")), role, service.clock.now())


@router.delete("/silos/{silo}", status_code=204, response_class=Response, responses=CHANGED)
def delete_silo(
    silo: Key, person: PersonOf, service: ServiceOf, request: Request, if_match: IfMatch = None
) -> Response:
    """Takes a silo out of sight; its readings stay, and `PUT` brings it back."""
    return _removed(service, Change("silo", silo, person, if_match, address_of(request)))


@router.get("/cameras", response_model=models.Page[models.Camera], responses=refusals())
def get_cameras(connection: Reading, person: PersonOf) -> models.Page[models.Camera]:
    """Cameras of the silos that may be seen."""
    silos = {row.id: row for row in places.listed(connection, "silo")}
    rows = [row for row in places.listed(connection, "camera") if row.silo in silos]
    seen = [row for row in rows if person.may("viewer", access.around(connection, silos[row.silo]))]
    return models.Page(items=[_camera(connection, row) for row in seen])


@router.put("/cameras/{camera}", response_model=models.Camera, responses=CHANGED)
def put_camera(
    camera: Key,
    body: models.CameraChange,
    person: PersonOf,
    service: ServiceOf,
    request: Request,
    response: Response,
    if_match: IfMatch = None,
) -> models.Camera:
    """Makes or changes a camera; a new one names its silo."""
    values = _given(body)
    _not_null(values, "silo")
    _check_files(values)
    with service.store.read() as connection:
        if places.get(connection, "camera", camera) is None and "silo" not in values:
            raise Problem("invalid", "'silo' is missing: a camera hangs in one")
    row = _kept(service, Change("camera", camera, person, if_match, address_of(request)), values, {})
    tell(response, row)
    with service.store.read() as connection:
        return _camera(connection, row)


def _check_files(values: dict[str, Any]) -> None:
    """Raises `Problem` for intrinsics or a sensor that can't be used."""
    from siloscope import sensors
    from siloscope.io import camera_files

    if values.get("sensor") is not None and values["sensor"] not in sensors.names():
        raise Problem("invalid", f"'sensor': known are {', '.join(sensors.names())}")
    if values.get("intrinsics") is not None:
        try:
            camera_files.parse("intrinsics", values["intrinsics"])
        except InputError as error:
            raise Problem("invalid", str(error)) from None


@router.delete("/cameras/{camera}", status_code=204, response_class=Response, responses=CHANGED)
def delete_camera(
    camera: Key, person: PersonOf, service: ServiceOf, request: Request, if_match: IfMatch = None
) -> Response:
    """Takes a camera out of use; what it measured stays."""
    return _removed(service, Change("camera", camera, person, if_match, address_of(request)))


@router.get("/products", response_model=models.Page[models.Product], responses=refusals())
def get_products(connection: Reading, person: PersonOf) -> models.Page[models.Product]:
    """What silos may hold."""
    need("viewer", person) if person.highest is None else None
    return models.Page(items=[_product(row) for row in places.listed(connection, "product")])


@router.get("/usual-products", response_model=models.Page[models.UsualProduct], responses=refusals())
def get_usual_products(_person: PersonOf) -> models.Page[models.UsualProduct]:
    """The built-in table of bulk densities, with the spread between lots."""
    from siloscope.content.density import products

    items = [
        models.UsualProduct(name=name, density_kg_m3=one.loose, density_std_kg_m3=one.std)
        for name, one in sorted(products().items())
    ]
    return models.Page(items=items)


@router.put("/products/{product}", response_model=models.Product, responses=CHANGED)
def put_product(
    product: Key,
    body: models.ProductChange,
    person: PersonOf,
    service: ServiceOf,
    request: Request,
    response: Response,
    if_match: IfMatch = None,
) -> models.Product:
    """Makes or changes a product; readings of before keep the density that they were made with."""
    told = _given(body)
    _not_null(told, "name", "density_kg_m3", "density_std_kg_m3")
    with service.store.read() as connection:
        before = places.get(connection, "product", product)
    document = {"name": product, "std": 0.0} if before is None else dict(before.document)
    names = {"name": "name", "density_kg_m3": "loose", "density_std_kg_m3": "std"}
    document |= {names[name]: value for name, value in told.items()}
    if "loose" not in document:
        raise Problem("invalid", "'density_kg_m3' is missing")
    if document["std"] > document["loose"]:
        raise Problem("invalid", "'density_std_kg_m3' is more than the density")
    values = {"name": document["name"], "density": document["loose"], "density_std": document["std"]}
    change = Change("product", product, person, if_match, address_of(request))
    row = _kept(service, change, values | {"document": document}, {})
    tell(response, row)
    return _product(row)
