"""Every kind of fault by its name, and the faults of a scenario put around a run's nodes."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from typing import Any

from hil.contract.node import Node
from hil.faults import camera, car, detector, firmware, mavlink, mocap, policy, services, vehicle
from hil.faults.fault import Fault, Setting
from hil.faults.node import FaultyNode
from hil.faults.timetable import Timetable
from hil.faults.wire import FaultyWires
from kernel.random import stream
from kernel.toml_errors import ConfigError, nearest, validate
from scenarios.faults import FaultTable

DIRECTOR = "director"

_FAMILIES = (camera, detector, mocap, mavlink, vehicle, firmware, car, policy, services)
KINDS: dict[str, type[Fault]] = {one.kind: one for family in _FAMILIES for one in family.KINDS}


def read_parameters(table: FaultTable) -> Any:
    """The table's parameters. Raises ConfigError for an unknown kind or parameter, naming the nearest one."""
    kind = KINDS.get(table.kind)
    if kind is None:
        known = ", ".join(KINDS)
        raise ConfigError(f'there is no fault "{table.kind}"{nearest(table.kind, tuple(KINDS))} Known: {known}')
    return validate(table.parameters, kind.Parameters, f"fault {table.title}")


def check_faults(tables: Sequence[FaultTable], setting: Setting) -> None:
    """Raises ConfigError for a fault that is unknown, or that cannot act in such a run."""
    for table in tables:
        parameters, kind = read_parameters(table), KINDS[table.kind]
        why = kind.complaint(parameters, setting)
        if kind.final and table.lasts_s is not None:
            why = f"does not end, and cannot last {table.lasts_s:g} s: leave `for` out"
        if why:
            raise ConfigError(f"fault {table.title}: {why}")


def with_faults(
    name: str,
    build: Callable[[Any], Node],
    wires: Any,
    tables: Sequence[FaultTable],
    setting: Setting,
    key: tuple[int, str],
) -> Node:
    """The node `name`, made by `build(wires)`, with the faults of `tables` that act on it around it.

    `key`: the run's seed and the scenario's name, of which each fault has a random stream of its own.
    """
    acting: dict[int, Fault] = {}
    for place, table in enumerate(tables):
        kind, parameters = KINDS[table.kind], read_parameters(table)
        places = kind.places(parameters, setting)
        if name in places:
            words = [zlib.crc32(text.encode()) for text in (key[1], table.kind, name)]
            acting[place] = kind(parameters, stream(key[0], *words, place, table.seed))
            acting[place].live, acting[place].lasts_s = setting.live and name == places[0], table.lasts_s
    if acting:
        decorated = FaultyWires(wires, list(acting.values()))
        node: Node = FaultyNode(build, acting, decorated)
    else:
        node = build(wires)
    return Timetable(node, tables, "camera" in setting.nodes) if tables and name == DIRECTOR else node
