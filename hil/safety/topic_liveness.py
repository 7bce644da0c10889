"""Liveness in a live run: which topic or service is no longer received, and which process is to blame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hil.contract.topics import TOPICS

AGE_LIMIT_S = 1.0  # a topic older than this, or than ten times its contract's age, is an abort
HEALTH_AGE_S = 0.9  # services publish their health twice a second
# Not watched: large; or not published, by design, once the gate has tripped or the referee has decided; or frequent and
# of simulated devices, whose health is received twice a second like that of every service
NOT_WATCHED = ("camera/image", "vehicle/sent", "truth/vehicle", "truth/board")
RECORDER_AGE_S = 2.0  # it writes in bursts, and no process waits for it


def liveness_fault(
    now_ns: int, health: Mapping[str, Mapping[str, Any]], received: Mapping[str, int], watched: Iterable[str]
) -> str:
    """Which process does not answer, in words; empty while all is well.

    `health`: the newest health of each service, with `received_ns`; `received`: topic -> when its newest message was
    received (ns, both on the clock of `now_ns`). Of the `watched` services those count that have published a health.
    """
    ages = {s: (now_ns - health[s]["received_ns"]) * 1e-9 for s in watched if s in health}
    stale = {
        topic: (now_ns - at_ns) * 1e-9
        for topic, at_ns in list(received.items())
        if now_ns - at_ns > max(AGE_LIMIT_S * 1e9, TOPICS[topic].max_age_ms * 1e7)
    }
    recorder_s = ages.pop("recorder", 0.0)
    late = {service: age for service, age in ages.items() if age > HEALTH_AGE_S}
    very_late = max(late.values(), default=0.0) > AGE_LIMIT_S + 1.0
    if (stale or very_late) and len(late) == len(ages) > 1:
        return f"hub does not answer: no service was received for {min(ages.values()):.1f} s"
    if late and (stale or very_late):  # all of them: one that hangs on a busy core can keep others from answering
        worst = sorted(late, key=lambda name: -late[name])
        return "; ".join(f"{service} does not answer: no health for {late[service]:.1f} s" for service in worst)
    if recorder_s > RECORDER_AGE_S:
        return f"recorder does not answer: no health for {recorder_s:.1f} s"
    for topic, age in stale.items():
        return f"{publisher(topic, health)} has not published {topic} for {age:.1f} s"
    return ""


def publisher(topic: str, health: Mapping[str, Mapping[str, Any]]) -> str:
    """The service that declares `topic` among its outputs."""
    for service, table in list(health.items()):
        if topic in table.get("outputs", ()):
            return service
    return "an unknown service"
