"""A wire with faults on it, at one node's end."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from typing import Any

from hil.faults.fault import Fault


class FaultyWire:
    """Decorates any wire of `hil.contract.wire`. `now_ns` and `active` are set by the node's decorator."""

    def __init__(self, wire: Any, faults: Sequence[Fault]) -> None:
        self._wire, self._faults = wire, faults
        self.now_ns = 0
        self.active: frozenset[Fault] = frozenset()
        self._waiting: dict[bool, list[tuple[int, int, Any]]] = {True: [], False: []}
        self._serial = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._wire, name)

    def send(self, item: Any) -> Any:
        """Send what the faults leave of `item`. The answer is the wire's, False if a fault has the wire refuse it."""
        acting = [fault for fault in self._faults if fault in self.active]
        if not acting and not self._waiting[True]:
            return self._wire.send(item)
        if any(fault.refuses for fault in acting):
            return False
        self._carry(acting, item, True)
        self.flush()
        return True

    def receive(self) -> list[Any]:
        """What the faults leave of what has come."""
        items = self._wire.receive()
        acting = [fault for fault in self._faults if fault in self.active]
        if not acting and not self._waiting[False]:
            return items
        for item in items:
            self._carry(acting, item, False)
        return self._due(False)

    def flush(self) -> None:
        """Send what has waited long enough."""
        for item in self._due(True):
            self._wire.send(item)

    def close(self) -> None:
        self._wire.close()

    def _carry(self, acting: Sequence[Fault], item: Any, outward: bool) -> None:
        items = [(0, item)]
        for fault in acting:
            items = [(late + more, got) for late, one in items for more, got in fault.carried(one, outward)]
        for late_ns, one in items:
            self._serial += 1
            heapq.heappush(self._waiting[outward], (self.now_ns + late_ns, self._serial, one))

    def _due(self, outward: bool) -> list[Any]:
        waiting, items = self._waiting[outward], []
        while waiting and waiting[0][0] <= self.now_ns:
            items.append(heapq.heappop(waiting)[2])
        return items


class FaultyWires:
    """A host's wires, of which those that are opened here are decorated."""

    def __init__(self, wires: Any, faults: Sequence[Fault]) -> None:
        self._wires, self._faults = wires, faults
        self._inner: dict[str, Any] = {}
        self.opened: list[FaultyWire] = []

    def _decorated(self, name: str, open_wire: Callable[[], Any]) -> FaultyWire:
        """A wire is opened once: a node that is built again gets the same one, whose address is taken."""
        if name not in self._inner:
            self._inner[name] = open_wire()
        self.opened.append(FaultyWire(self._inner[name], self._faults))
        return self.opened[-1]

    def vehicle_system(self) -> int:
        return self._wires.vehicle_system()

    def vehicle_link(self) -> FaultyWire:
        return self._decorated("vehicle_link", self._wires.vehicle_link)

    def vehicle_device(self) -> FaultyWire:
        return self._decorated("vehicle_device", self._wires.vehicle_device)

    def car_link(self) -> FaultyWire:
        return self._decorated("car_link", self._wires.car_link)

    def car_device(self) -> FaultyWire:
        return self._decorated("car_device", self._wires.car_device)
