"""Checks the graph of a live run, as declared by its services, against the contract before the run starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from hil.contract.graph import check_graph
from hil.contract.node import Node
from hil.contract.topics import Knows


class Declared(NamedTuple):
    """The declaration of a node that runs in another process."""

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    wakes: tuple[str, ...]
    period_ns: int


def declare(nodes: Iterable[Node]) -> list[list[Any]]:
    """The nodes of one service as a table that JSON can carry, for its health."""
    return [[n.name, list(n.inputs), list(n.outputs), list(n.wakes), n.period_ns] for n in nodes]


def check_live_graph(health: Mapping[str, Mapping[str, Any]], services: Sequence[str], knows: Knows = "camera") -> None:
    """Raises GraphError if the nodes that `services` have declared in their health do not fit the contract, with a
    policy that `knows` the board by camera or motion capture."""
    rows = [row for service in services for row in health.get(service, {}).get("graph", ())]
    check_graph(
        [
            Declared(name, tuple(inputs), tuple(outputs), tuple(wakes), period)
            for name, inputs, outputs, wakes, period in rows
        ],
        knows,
    )
