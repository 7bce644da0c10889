"""Access rights of each identity on a closed bus, derived from the contract table, as the hub's access-control list.

An identity is the common name of a certificate. It may publish what its service's nodes publish and receive what the
contract lets them read: the policy's identity cannot read the car's truth, and only the gate's process can publish what
was sent to the vehicle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hil.bus.clock import CLOCK
from hil.bus.leaf import CONTROL, EVENT, HEALTH, OBSERVERS, TOPIC, received_on
from hil.contract.topics import TOPICS, Knows, may_read, published_by


def access_control(services: Mapping[str, Sequence[str]], knows: Knows = "camera") -> dict[str, Any]:
    """The hub's table for `services` (service -> its nodes): everything that is not allowed is denied.

    `knows`: by what the policy may know of the board."""
    rules, subjects, policies = [], [], []

    def allow(service: str, publish: list[str], receive: list[str]) -> None:
        wanted = [received_on("event") if key.startswith(EVENT) else key for key in publish]
        for what, message, flow, keys in (
            ("in", "put", "ingress", publish),
            ("out", "put", "egress", receive),
            ("sub", "declare_subscriber", "ingress", receive),
            ("wanted", "declare_subscriber", "egress", wanted),  # a publisher without a known reader does not publish
        ):
            if not keys:  # who only reads has no such rule: nothing is allowed
                continue
            rules.append(
                {
                    "id": f"{service}-{what}",
                    "messages": [message],
                    "flows": [flow],
                    "key_exprs": keys,
                    "permission": "allow",
                }
            )
        subjects.append({"id": service, "cert_common_names": [service]})
        own = [f"{service}-{what}" for what in (("in", "out", "sub", "wanted") if publish else ("out", "sub"))]
        policies.append({"rules": [*own, "clock"], "subjects": [service]})

    everything = [received_on(topic) for topic in TOPICS]
    rules.append({
        "id": "clock", "messages": ["query", "reply"], "flows": ["ingress", "egress"], "key_exprs": [CLOCK],
        "permission": "allow",
    })  # fmt: skip
    present = {node for nodes in services.values() for node in nodes}
    for service, nodes in services.items():
        outputs = {topic for node in nodes for topic in published_by(node, present)}
        publish = sorted({TOPIC + t for t in outputs} | {EVENT + service, HEALTH + service})
        receive = sorted({received_on(t) for t in TOPICS for node in nodes if may_read(node, t, knows)} | {CONTROL})
        allow(service, publish, receive)
    for observer in OBSERVERS:
        publish = [] if observer == "viewer" else [HEALTH + observer]
        publish += [CONTROL, EVENT + observer] if observer == "supervisor" else []
        allow(observer, publish, [*everything, HEALTH + "*", CONTROL])
    return {
        "enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies,
    }  # fmt: skip
