"""What the service tells others: what waits, what was given up, and trying it again."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Path, Query

from siloscope.monitor.api import models, views
from siloscope.monitor.api.context import Count, PersonOf, Reading, ServiceOf, need, refusals
from siloscope.monitor.problems import Problem
from siloscope.monitor.store import deliveries, people

router = APIRouter(tags=["deliveries"])

LARGEST = (1 << 62) - 1


@router.get("/deliveries", response_model=models.Page[models.Delivery], responses=refusals("forbidden"))
def get_deliveries(
    connection: Reading,
    person: PersonOf,
    state: Literal["pending", "failed", "delivered"] = "pending",
    after: Annotated[int | None, Query(ge=0, le=LARGEST, description="Cursor: `next` of the page before.")] = None,
    count: Count = 100,
) -> models.Page[models.Delivery]:
    """Alerts on their way out, the newest first; "failed" is what is tried no more."""
    need("operator", person)
    rows = deliveries.listed(connection, state, after, count + 1)
    items = [_delivery(row, state) for row in rows[:count]]
    return models.Page(items=items, next=str(rows[count - 1].id) if len(rows) > count else None)


def _delivery(row: Any, state: Literal["pending", "failed", "delivered"]) -> models.Delivery:
    return models.Delivery(
        id=row.id,
        channel=row.channel,
        key=row.key,
        alert=row.payload.get("alert"),
        state=state,
        created=views.at(row.created),
        attempts=row.attempts,
        next=views.at(row.next) if state == "pending" else None,
        delivered=views.at(row.delivered),
        error=row.error,
    )


@router.post(
    "/deliveries/{delivery}:retry",
    status_code=204,
    responses=refusals("forbidden", "not-found", "cross-origin"),
)
def retry(delivery: Annotated[int, Path(ge=0, le=LARGEST)], person: PersonOf, service: ServiceOf) -> None:
    """Tries an undelivered thing again at once."""
    need("operator", person)
    now = service.clock.now()
    with service.store.write() as connection:
        if not deliveries.again(connection, delivery, now):
            raise Problem("not-found", f"there is no undelivered thing '{delivery}'")
        people.log(connection, now, person.name, "retry delivery", str(delivery))
