"""Replay: chosen nodes of a recorded run are stepped again with the current code, on each step's recorded inputs.

Their output is compared with the recording, message by message and number by number. Nodes on a device's wire cannot be
replayed: bytes on wires are not recorded.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from hil.assembly.builder import Assembly
from hil.assembly.node_table import NODES
from hil.assembly.rig import Rig
from hil.assembly.simulation import MemoryWires
from hil.contract.node import Inbox, Node
from hil.recording.reader import Recording
from hil.recording.receipts import Receipt, read_receipts
from hil.recording.runs import Run, open_run
from policies.flying.registry import policy_factory
from scenarios.draw import draw
from scenarios.spec import Scenario
from vehicle.quadrotor.airframe import load_airframe

MEASURED = ("board/detection.processing_ns",)  # differs by nature in a live run


class ReplayError(ValueError):
    """The run cannot be replayed; the text states why."""


@dataclass(frozen=True, slots=True)
class TopicReplay:
    """One topic of one node: how much was compared, and the first difference if there is one."""

    node: str
    topic: str
    compared: int
    differing: int
    first: str  # empty if nothing differs
    largest: float  # of all differences of numbers


@dataclass(frozen=True, slots=True)
class Replay:
    """What a replay found. `skipped`: node -> why it was not replayed."""

    topics: tuple[TopicReplay, ...]
    skipped: Mapping[str, str]

    @property
    def same(self) -> bool:
        return all(not t.differing for t in self.topics)

    def lines(self) -> list[str]:
        """What to print."""
        lines = []
        for t in self.topics:
            verdict = f"{t.differing} differ, by up to {t.largest:.3g}; first: {t.first}" if t.differing else "the same"
            lines.append(f"{t.node:13s} {t.topic:18s} {t.compared:6d} messages: {verdict}")
        return lines + [f"{node:13s} not replayed: {why}" for node, why in self.skipped.items()]


def replay_run(
    path: Path | str,
    nodes: Sequence[str] = (),
    *,
    tolerance: float = 0.0,
    ignore: Iterable[str] = (),
    policy: str | None = None,
) -> Replay:
    """Replay `nodes` (default: all that can be) of the run folder `path`.

    `tolerance`: absolute and relative difference of numbers that counts as none. `ignore`: "topic" or "topic.field"
    not to be compared. `policy` flies in the place of the run's own. Raises ReplayError, RunError or ReadError.
    """
    run = open_run(path)
    assembly, rig = _assembly(run, policy)
    receipts, recording = read_receipts(run.path), Recording(run.recording)
    if not receipts:
        raise ReplayError(f"{run.path} has no receipts: it was flown before there were any, or not by this host")
    known = [name for name in assembly.names if not NODES[name].slot and not NODES[name].measures(rig)]
    for name in nodes:
        if name not in known:
            raise ReplayError(f"node {name!r} cannot be replayed; of this run can be: {', '.join(known)}")
    ignored = {*ignore, *(MEASURED if run.manifest.get("host") == "live" else ())}
    found: list[TopicReplay] = []
    skipped: dict[str, str] = {}
    for name in nodes or known:
        if name not in receipts:
            skipped[name] = "it left no receipts"
            continue
        node = assembly.node(name)
        inputs, steps = receipts[name]
        missing = [t for t in node.inputs if f"/perch/{t}" not in recording.topics]
        if inputs != tuple(node.inputs):
            skipped[name] = f"it read {', '.join(inputs)} then and reads {', '.join(node.inputs)} now"
        elif missing:
            skipped[name] = f"{', '.join(missing)} was not recorded (--pictures raw keeps pictures)"
        else:
            found += _replay_node(node, steps, recording, _numbers(run.path), ignored, tolerance)
        node.close()
    return Replay(tuple(found), skipped)


def _assembly(run: Run, policy: str | None) -> tuple[Assembly, Rig]:
    manifest = run.manifest
    try:
        scenario = Scenario.model_validate(manifest["scenario"])
        rig = Rig.model_validate({k: v for k, v in manifest["rig"].items() if k not in ("name", "source")})
    except ValueError as error:
        raise ReplayError(f"{run.path}: its manifest fits no current scenario or rig: {error}") from None
    named = manifest["policy"]
    name, airframe = policy or named.get("path") or named["name"], load_airframe(rig.vehicle.airframe)
    stage = "state" if rig.policy.knows == "mocap" else None
    make = policy_factory(name, airframe, guidance=rig.policy.guidance, stage=stage)
    wires = MemoryWires(rig, lambda: 0)
    stopwatch = (lambda: 0) if manifest.get("host") == "live" else None
    return Assembly(scenario, rig, draw(scenario, manifest["seed"]), make, wires, stopwatch), rig


def _numbers(run: Path) -> dict[str, dict[str, Any]]:
    """What the live recorder missed, by topic; empty for lockstep, which misses nothing."""
    path = run / "numbers.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _numbered(recording: Recording, topic: str, numbers: Mapping[str, Any]) -> Iterator[tuple[int, Any]]:
    """(number, message) of a topic as its publisher numbered them."""
    table = numbers.get(topic, {"first": 0, "missing": []})
    # a recording of before they were pairs has single numbers
    ranges = iter([one if isinstance(one, list) else (one, one) for one in table["missing"]])
    number, (first, last) = table["first"], next(ranges, (-1, -1))
    for entry in recording.messages([topic]):
        while number == first:
            number, (first, last) = last + 1, next(ranges, (-1, -1))
        yield number, entry.message
        number += 1


def _replay_node(
    node: Node,
    steps: Sequence[Receipt],
    recording: Recording,
    numbers: Mapping[str, Any],
    ignored: set[str],
    tolerance: float,
) -> list[TopicReplay]:
    inputs = {topic: dict(_numbered(recording, topic, numbers)) for topic in node.inputs}
    outputs: dict[str, list[tuple[int, Any]]] = {t: [] for t in node.outputs if t != "event"}
    unknown = 0
    inbox = Inbox(node.inputs)
    counts = dict.fromkeys(outputs, 0)
    for step in steps:
        at = 0
        for topic in node.inputs:
            count = step.consumed[at]
            for number in step.consumed[at + 1 : at + 1 + count]:
                message = inputs[topic].get(number)
                if message is None:
                    unknown += 1  # the node had it, the recorder had not
                else:
                    inbox.put(topic, message)
            at += 1 + count
        for out in node.step(step.stamp_ns, inbox):
            if out.topic in outputs:
                outputs[out.topic].append((counts[out.topic], out.message))
                counts[out.topic] += 1
        inbox.clear()
    then = {
        topic: dict(_numbered(recording, topic, numbers)) for topic in outputs if f"/perch/{topic}" in recording.topics
    }
    return [
        _compare(node.name, topic, then[topic], outputs[topic], ignored, tolerance, unknown)
        for topic in outputs
        if topic in then and topic not in ignored
    ]


def _compare(
    node: str,
    topic: str,
    then: Mapping[int, Any],
    now: Sequence[tuple[int, Any]],
    ignored: set[str],
    tolerance: float,
    unknown: int,
) -> TopicReplay:
    compared = differing = 0
    first, largest = "", 0.0
    for number, message in now:
        if number not in then:  # lost on the way to the recorder, or after its end
            continue
        compared += 1
        fault = _difference(topic, then[number], message, ignored, tolerance)
        if fault is not None:
            differing += 1
            largest = max(largest, fault[1])
            first = first or f"message {number} at {message.stamp_ns / 1e9:.4f} s: {fault[0]}"
    extra = [n for n in then if n >= len(now)]
    if extra and not unknown:
        differing += len(extra)
        first = first or f"the run has {len(extra)} messages more, from number {extra[0]} on"
    if first and unknown:
        first += f" ({unknown} inputs of this node are not in the recording)"
    return TopicReplay(node, topic, compared, differing, first, largest)


def _difference(topic: str, then: Any, now: Any, ignored: set[str], tolerance: float) -> tuple[str, float] | None:
    """(what differs, by how much), or None."""
    for name in (field.name for field in fields(then)):
        if f"{topic}.{name}" in ignored:
            continue
        a, b = getattr(then, name), getattr(now, name)
        if repr(a) == repr(b):
            continue
        size = _size(a, b)
        scale = max((abs(x) for x in _flat(a) if isinstance(x, int | float)), default=0.0)
        if size is not None and size <= tolerance * max(1.0, scale):
            continue
        return f"{name} was {str(a)[:70]}, is {str(b)[:70]}", math.inf if size is None else size
    return None


def _flat(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)


def _size(a: Any, b: Any) -> float | None:
    """Largest difference of numbers of equal count; None where it is meaningless."""
    one, two = _flat(a), _flat(b)
    if len(one) != len(two) or not all(isinstance(v, int | float) for v in (*one, *two)):
        return None
    deltas = [0.0 if x == y or (x != x and y != y) else abs(x - y) for x, y in zip(one, two, strict=True)]
    largest = max(deltas, default=0.0)
    return None if largest != largest else largest


__all__ = ["Replay", "ReplayError", "TopicReplay", "replay_run"]
