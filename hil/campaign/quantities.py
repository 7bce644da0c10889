"""What a recorded attempt shows of vehicle, links, perception and car: samples of one number each, to be compared."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from hil.recording.reader import Recording
from kernel.rotations import rotate
from vehicle.quadrotor.airframe import GRAVITY

_GRID_S = 0.005
_WINDOW_S, _HOP_S = 0.8, 0.4
_LONGEST_S = 0.3  # of a delay
_TOPICS = (
    "run/stage", "vehicle/sent", "vehicle/odometry", "vehicle/status", "mocap/vehicle", "mocap/board", "truth/vehicle",
    "truth/board", "board/detection", "belief", "policy/action", "car/sent", "car/command", "car/feedback",
    "referee/contact",
)  # fmt: skip
_NEAR, _FAR = 1.5, 3.0  # m


class Quantity(NamedTuple):
    """`samples` of one number; a run that cannot show it has none."""

    name: str
    unit: str
    samples: np.ndarray


class Track(NamedTuple):
    """A signal: times (s) and values, (n,) or (n, k)."""

    t: np.ndarray
    values: np.ndarray


class Attempt:
    """The messages of a run's attempt by topic, with the time of their publication (ns). Raises ReadError.

    It ends with the referee's decision, or when the gate trips: from then on no command is sent.
    """

    def __init__(self, recording: Recording) -> None:
        self.messages: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in _TOPICS}
        tripped_ns: list[int] = []
        for log_ns, topic, message in recording.messages([t for t in _TOPICS if f"/perch/{t}" in recording.topics]):
            if topic == "vehicle/sent" and message.tripped:
                tripped_ns.append(message.stamp_ns)
            else:
                self.messages[topic].append((log_ns, message))
        stages = [message for _, message in self.messages["run/stage"]]
        self.start_ns = next((s.attempt_start_ns for s in stages if s.name == "attempt"), 0)
        decided = (m.stamp_ns for _, m in self.messages["referee/contact"] if m.outcome != "ongoing")
        self.end_ns = next(decided, max((log for log, _ in self.messages["run/stage"]), default=0))
        self.end_ns = min([self.end_ns, *tripped_ns])

    def track(self, topic: str, value: Callable[[Any], Any]) -> Track:
        """A field of the attempt's messages by their stamps; each stamp once."""
        found = {m.stamp_ns: value(m) for _, m in self.messages[topic] if self.start_ns <= m.stamp_ns <= self.end_ns}
        stamps = sorted(found)
        return Track(np.array(stamps, float) * 1e-9, np.array([found[stamp] for stamp in stamps], float))

    def first(self, *topics: str) -> str:
        """The first of the topics that has messages."""
        return next((topic for topic in topics if self.messages[topic]), topics[0])


def quantities(attempt: Attempt) -> list[Quantity]:
    """Every quantity of one attempt."""
    found = [*_rates(attempt), *_thrust(attempt), *_latencies(attempt), *_detections(attempt), *_estimate(attempt)]
    return [*found, *_car(attempt), *_impact(attempt)]


def response(asked: Track, got: Track) -> list[tuple[float, float]]:
    """(delay s, gain) of `got` after `asked`, in windows in which something was asked; both (n,)."""
    if len(asked.t) < 10 or len(got.t) < 10:
        return []
    low, high = max(asked.t[0], got.t[0]), min(asked.t[-1], got.t[-1])
    found: list[tuple[float, float]] = []
    begin = low + _LONGEST_S
    while begin + _WINDOW_S <= high:
        grid = np.arange(begin, begin + _WINDOW_S, _GRID_S)
        answer = np.interp(grid, got.t, got.values)
        best: tuple[float, float, float] | None = None
        for delay in np.arange(0.0, _LONGEST_S, _GRID_S):
            held = asked.values[np.clip(np.searchsorted(asked.t, grid - delay, side="right") - 1, 0, None)]
            spread = float(np.std(held))
            if spread < 0.05:
                continue
            centred = held - held.mean()
            gain = float(np.dot(centred, answer - answer.mean()) / np.dot(centred, centred))
            left = float(np.std(answer - answer.mean() - gain * centred))
            if best is None or left < best[0]:
                best = (left, float(delay), gain)
        if best is not None:
            found.append(best[1:])
        begin += _HOP_S
    return found


def _pair(name: str, unit: str, found: Sequence[tuple[float, float]]) -> list[Quantity]:
    delays, gains = (np.array([one[k] for one in found]) for k in (0, 1))
    return [Quantity(f"{name}, delay", "s", delays), Quantity(f"{name}, gain", unit, gains)]


def _rates(attempt: Attempt) -> list[Quantity]:
    asked = attempt.track("vehicle/sent", lambda m: m.body_rate)
    got = attempt.track("vehicle/odometry", lambda m: m.body_rate)
    found: list[Quantity] = []
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        pairs = [] if not len(asked.t) or not len(got.t) else response(
            Track(asked.t, asked.values[:, axis]), Track(got.t, got.values[:, axis])
        )  # fmt: skip
        found += _pair(f"{name} rate", "1", pairs)
    return found


def _thrust(attempt: Attempt) -> list[Quantity]:
    """Achieved over asked thrust, from the odometry's acceleration, and the hover thrust that was learned."""
    asked = attempt.track("vehicle/sent", lambda m: m.thrust)
    moved = attempt.track("vehicle/odometry", lambda m: (*m.velocity, *m.orientation))
    ratios: list[float] = []
    if len(asked.t) > 10 and len(moved.t) > 10:
        for k in range(5, len(moved.t) - 5, 5):
            seconds = moved.t[k + 5] - moved.t[k - 5]
            accel = (moved.values[k + 5, :3] - moved.values[k - 5, :3]) / max(seconds, 1e-3)
            up = rotate(tuple(moved.values[k, 3:].tolist()), 0.0, 0.0, 1.0)
            force = float(accel[0] * up[0] + accel[1] * up[1] + (accel[2] + GRAVITY) * up[2])
            wanted = float(np.interp(moved.t[k] - 0.04, asked.t, asked.values))
            ratios.append(force / wanted)
    learned = [m.hover_thrust for _, m in attempt.messages["vehicle/status"] if m.hover_thrust > 0.0]
    return [
        Quantity("thrust, achieved over asked", "1", np.array(ratios)),
        Quantity("hover thrust", "1", np.array(learned[-20:])),
    ]


def _latencies(attempt: Attempt) -> list[Quantity]:
    def since(topic: str, stamp: Callable[[Any], int]) -> np.ndarray:
        found = [(log, stamp(m)) for log, m in attempt.messages[topic]]
        return np.array([(log - at) * 1e-9 for log, at in found if at >= attempt.start_ns and at <= attempt.end_ns])

    return [
        Quantity("exposure to detection", "s", since("board/detection", lambda m: m.stamp_ns)),
        Quantity("exposure to action", "s", since("policy/action", lambda m: m.exposure_ns)),
        Quantity("action to wire", "s", _action_to_wire(attempt)),
        Quantity("odometry, age at arrival", "s", since("vehicle/odometry", lambda m: m.stamp_ns)),
        Quantity("motion capture, age at arrival", "s", since("mocap/vehicle", lambda m: m.stamp_ns)),
    ]


def _action_to_wire(attempt: Attempt) -> np.ndarray:
    actions = sorted(m.stamp_ns for _, m in attempt.messages["policy/action"])
    if not actions:
        return np.array([])
    stamps = np.array(actions)
    sent = np.array([m.stamp_ns for _, m in attempt.messages["vehicle/sent"]])
    place = np.searchsorted(stamps, sent, side="right") - 1
    return (sent - stamps[np.clip(place, 0, None)])[place >= 0] * 1e-9


def _detections(attempt: Attempt) -> list[Quantity]:
    """Share of pictures that show the board, and error of its pose, near and far."""
    board_topic = attempt.first("truth/board", "mocap/board")
    board = attempt.track(board_topic, lambda m: (*m.position, *_normal(m.orientation)))
    vehicle = attempt.track(attempt.first("truth/vehicle", "mocap/vehicle"), lambda m: m.position)
    found: dict[str, list[float]] = {}
    if len(board.t) > 1 and len(vehicle.t) > 1:
        for _, seen in attempt.messages["board/detection"]:
            t = seen.stamp_ns * 1e-9
            if not attempt.start_ns <= seen.stamp_ns <= attempt.end_ns:
                continue
            place = np.array([np.interp(t, board.t, board.values[:, k]) for k in range(6)])
            here = np.array([np.interp(t, vehicle.t, vehicle.values[:, k]) for k in range(3)])
            away = float(np.linalg.norm(place[:3] - here))
            where = "near" if away < _NEAR else "between" if away < _FAR else "far"
            found.setdefault(f"rate {where}", []).append(float(seen.found))
            if seen.found:
                found.setdefault(f"position {where}", []).append(float(np.linalg.norm(place[:3] - seen.position)))
                cosine = float(np.dot(_normal(seen.orientation), place[3:] / np.linalg.norm(place[3:])))
                found.setdefault(f"normal {where}", []).append(math.acos(max(-1.0, min(1.0, cosine))))
    names = {"rate": ("detection rate", "1"), "position": ("pose error", "m"), "normal": ("normal error", "rad")}
    ranges = {"near": f"below {_NEAR:g} m", "between": f"{_NEAR:g} to {_FAR:g} m", "far": f"above {_FAR:g} m"}
    return [
        Quantity(f"{name}, {ranges[where]}", unit, np.array(found.get(f"{key} {where}", [])))
        for key, (name, unit) in names.items()
        for where in ranges
    ]


def _normal(orientation: tuple[float, float, float, float]) -> tuple[float, float, float]:
    x, y, z = rotate(orientation, 0.0, 0.0, 1.0)
    return float(x), float(y), float(z)


def _estimate(attempt: Attempt) -> list[Quantity]:
    """Odometry against motion capture: what scatters, and by how much it lags."""
    known = attempt.track(attempt.first("truth/vehicle", "mocap/vehicle"), lambda m: (*m.position, *m.velocity))
    told = attempt.track("vehicle/odometry", lambda m: (*m.position, *m.velocity))
    if len(known.t) < 20 or len(told.t) < 20:
        return [Quantity(name, unit, np.array([])) for name, unit in _ESTIMATE]
    there = np.array([np.interp(told.t, known.t, known.values[:, k]) for k in range(6)]).T
    off = told.values - there
    position = np.linalg.norm(off[:, :3] - off[:, :3].mean(axis=0), axis=1)
    lags = []
    for axis in range(3):
        lags += response(Track(known.t, known.values[:, 3 + axis]), Track(told.t, told.values[:, 3 + axis]))
    samples = (position, np.linalg.norm(off[:, 3:], axis=1), np.array([delay for delay, _ in lags]))
    return [Quantity(name, unit, values) for (name, unit), values in zip(_ESTIMATE, samples, strict=True)]


_ESTIMATE = (("odometry, scatter of position", "m"), ("odometry, error of velocity", "m/s"), ("estimator, lag", "s"))


def _car(attempt: Attempt) -> list[Quantity]:
    asked = attempt.track(attempt.first("car/sent", "car/command"), lambda m: m.speed)
    found = response(asked, attempt.track("car/feedback", lambda m: m.speed))
    return _pair("car speed", "1", found)


def _impact(attempt: Attempt) -> list[Quantity]:
    contact = next((m for _, m in attempt.messages["referee/contact"] if m.outcome != "ongoing" and m.x == m.x), None)
    touched = contact is not None and (contact.attached or contact.within_tolerance)
    into = [abs(contact.normal_speed)] if contact is not None and touched else []
    along = [contact.tangential_speed] if contact is not None and touched else []
    return [
        Quantity("impact, into the board", "m/s", np.array(into)),
        Quantity("impact, along", "m/s", np.array(along)),
    ]
