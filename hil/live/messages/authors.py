"""Who is behind an event: the service on whose key it came, whatever it says of itself."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from hil.assembly.node_table import NODES, SERVICES
from hil.bus.mailbox import Delivery
from hil.contract.messages import Event

_GATES = {"vehicle_link": "gate", "car_link": "car_gate"}  # sources of events within a node
_FAULT = "fault"  # the source of events of a scenario's faults, which act on any node


@cache
def sources(service: str) -> frozenset[str]:
    """Names that `service` may give as the source of an event: its own, those of its nodes and of their gates, and
    that of faults."""
    if service not in SERVICES:
        return frozenset((service,))
    nodes = [name for name, row in NODES.items() if row.service.name == service]
    return frozenset((service, _FAULT, *nodes, *(_GATES[node] for node in nodes if node in _GATES)))


def attributed(delivery: Delivery) -> Delivery:
    """The delivery as it came; an event under a name that is not its author's has the author's, and says so.

    On a closed bus the author is certain: the hub lets an identity publish events on its own key only.
    """
    event = delivery.message
    if not isinstance(event, Event) or event.source in sources(delivery.author):
        return delivery
    text = f'(gave "{event.source[:40]}" as its name) {event.text}'
    return delivery._replace(message=replace(event, source=delivery.author, text=text))
