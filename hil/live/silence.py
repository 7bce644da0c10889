"""Who has fallen silent in a live run, and who of those is to blame: judged by the age of what was last heard."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hil.contract.topics import TOPICS

AGE_LIMIT_S = 1.0  # a topic silent for longer than this, or ten times its contract's age, is an abort
MUTE_S = 0.9  # services say their health twice a second
RECORDER_MUTE_S = 2.0  # it has much to write now and then, and nobody waits for it


def silence(
    now_ns: int, health: Mapping[str, Mapping[str, Any]], heard: Mapping[str, int], watched: Iterable[str]
) -> str:
    """Who does not answer, in words; empty while all is well.

    `health`: what each service has said of itself, with `heard_ns`; `heard`: topic -> when it was last heard (ns, both
    on the clock of `now_ns`). Of `watched` services those count that have said something.
    """
    ages = {s: (now_ns - health[s]["heard_ns"]) * 1e-9 for s in watched if s in health}
    silent = {
        topic: (now_ns - heard_ns) * 1e-9
        for topic, heard_ns in list(heard.items())
        if now_ns - heard_ns > max(AGE_LIMIT_S * 1e9, TOPICS[topic].max_age_ms * 1e7)
    }
    recorder_s = ages.pop("recorder", 0.0)
    mute = {service: age for service, age in ages.items() if age > MUTE_S}
    long_mute = max(mute.values(), default=0.0) > AGE_LIMIT_S + 1.0
    if (silent or long_mute) and len(mute) == len(ages) > 1:
        return f"hub does not answer: nothing has come from anybody for {min(ages.values()):.1f} s"
    if mute and (silent or long_mute):
        service = max(mute, key=lambda name: mute[name])
        return f"{service} does not answer: silent for {mute[service]:.1f} s"
    if recorder_s > RECORDER_MUTE_S:
        return f"recorder does not answer: silent for {recorder_s:.1f} s"
    for topic, age in silent.items():
        return f"{_producer(topic, health)} is silent on {topic} for {age:.1f} s"
    return ""


def _producer(topic: str, health: Mapping[str, Mapping[str, Any]]) -> str:
    for service, table in health.items():
        if topic in table.get("outputs", ()):
            return service
    return "somebody"
