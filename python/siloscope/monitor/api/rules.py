"""Rules: when an alert fires."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path, Request, Response
from sqlalchemy import Connection

from siloscope.monitor import access, rules
from siloscope.monitor.access import Person
from siloscope.monitor.api import models
from siloscope.monitor.api.context import PersonOf, Reading, ServiceOf, address_of, need, refusals
from siloscope.monitor.api.versions import IfMatch, must_match, tell
from siloscope.monitor.problems import Problem
from siloscope.monitor.store import alerts, people, places

router = APIRouter(tags=["rules"])

Key = Annotated[str, Path(max_length=80, pattern=r"^[A-Za-z0-9_-][A-Za-z0-9_.-]*$")]

CHANGED = refusals("forbidden", "cross-origin", "not-found", "changed-meanwhile", "precondition-required")


def _rule(row: Any) -> models.Rule:
    kind = rules.DEFAULTS[row.kind]
    names = ("id", "kind", "silo", "place", "level", "clear", "delay_s", "channels", "enabled", "version")
    return models.Rule(**{n: getattr(row, n) for n in names}, meaning=kind.meaning, unit=kind.unit)


@router.get("/rules", response_model=models.Page[models.Rule], responses=refusals("forbidden"))
def get_rules(connection: Reading, person: PersonOf) -> models.Page[models.Rule]:
    """All rules."""
    if person.highest in (None, "percent"):
        raise Problem("forbidden", "this needs the role viewer")
    return models.Page(items=[_rule(row) for row in alerts.rules(connection)])


@router.put("/rules/{rule}", response_model=models.Rule, responses=CHANGED)
def put_rule(
    rule: Key,
    body: models.RuleChange,
    person: PersonOf,
    service: ServiceOf,
    request: Request,
    response: Response,
    if_match: IfMatch = None,
) -> models.Rule:
    """Makes or changes a rule; what is left out stays, or has the kind's usual value."""
    told, now = body.model_dump(exclude_unset=True), service.clock.now()
    with service.store.write() as connection:
        before = alerts.rule_get(connection, rule)
        values = _values(before, told, rule)
        _may(connection, person, before, values)
        must_match(before, if_match, f"the rule '{rule}'")
        alerts.put_rule(connection, rule, values, now)
        people.log(connection, now, person.name, "set rule", rule, detail=told, address=address_of(request))
        row = alerts.rule_get(connection, rule)
    service.announce()
    tell(response, row)
    return _rule(row)


def _values(before: Any, told: dict[str, Any], key: str) -> dict[str, Any]:
    """The rule after a change."""
    kind = told.get("kind") or (before.kind if before else key)
    if kind not in rules.DEFAULTS:
        raise Problem("invalid", f"'kind': known are {', '.join(rules.KINDS)}")
    if before is not None and before.kind != kind:
        raise Problem("invalid", "'kind' of a rule stays; make another rule")
    usual = rules.DEFAULTS[kind]
    base: dict[str, Any] = {"place": None, "silo": None, "kind": kind, "level": usual.level, "clear": usual.clear}
    base |= {"delay_s": usual.delay_s, "channels": [], "enabled": True}
    if before is not None:
        base |= {name: before._mapping[name] for name in base}
    values = base | told | {"kind": kind}
    if "level" in told and "clear" not in told:
        values["clear"] = rules.clear_of(kind, told["level"])
    values |= {name: base[name] for name in ("delay_s", "channels", "enabled") if values[name] is None}
    if usual.level is not None and values["level"] is None:
        raise Problem("invalid", "'level' can't be null for this kind")
    level, clear = values["level"], values["clear"]
    if level is not None and clear is not None and (clear < level if usual.falling else clear > level):
        raise Problem("invalid", "'clear' lies beyond 'level'; the alert would end before it begins")
    return values


def _may(connection: Connection, person: Person, before: Any, values: dict[str, Any]) -> None:
    """Raises `Problem` unless the person administers all that the rule is for, before and after."""
    for one in (*(() if before is None else (before._mapping,)), values):
        silo = None if one["silo"] is None else places.get(connection, "silo", one["silo"])
        if one["silo"] is not None and silo is None:
            raise Problem("invalid", f"'silo': there is no silo '{one['silo']}'")
        if one["place"] is not None and places.get(connection, "place", one["place"]) is None:
            raise Problem("invalid", f"'place': there is no place '{one['place']}'")
        around = access.around(connection, silo) if silo is not None else places.above(connection, one["place"])
        need("admin", person, around)


@router.delete("/rules/{rule}", status_code=204, response_class=Response, responses=CHANGED)
def delete_rule(
    rule: Key, person: PersonOf, service: ServiceOf, request: Request, if_match: IfMatch = None
) -> Response:
    """Removes a rule; its alerts end and stay in the list."""
    now = service.clock.now()
    with service.store.write() as connection:
        row = alerts.rule_get(connection, rule)
        if row is None:
            raise Problem("not-found", f"there is no rule '{rule}'")
        _may(connection, person, row, dict(row._mapping))
        must_match(row, if_match, f"the rule '{rule}'")
        alerts.remove_rule(connection, rule, now)
        people.log(connection, now, person.name, "remove rule", rule, address=address_of(request))
    service.announce()
    return Response(status_code=204)
