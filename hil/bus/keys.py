"""Who may do what on a closed bus, derived from the contract table: an access-control list for the hub.

Each service proves who it is by the common name of its certificate. It may publish what its nodes publish and hear
what the contract lets them read, and nothing else: the policy's identity cannot read the car's truth, and only the
gate's process can publish what was sent to the vehicle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hil.bus.clock import CLOCK
from hil.bus.leaf import CONTROL, HEALTH, OBSERVERS, TOPIC
from hil.contract.topics import TOPICS, may_read

# What each node publishes; tests hold it to the nodes themselves.
OUTPUTS: dict[str, tuple[str, ...]] = {
    "car_device": ("truth/board",),
    "vehicle_device": ("truth/vehicle",),
    "mocap": ("mocap/vehicle", "mocap/board"),
    "director": ("run/stage",),
    "referee": ("referee/contact",),
    "car_follower": ("car/reference", "car/command"),
    "car_link": ("car/feedback", "car/sent", "truth/board"),
    "camera": ("camera/image", "board/detection"),
    "detector": ("board/detection",),
    "vehicle_link": (
        "vehicle/odometry",
        "vehicle/status",
        "vehicle/sent",
        "vehicle/parameters",
        "truth/vehicle",
    ),
    "belief": ("belief",),
    "policy": ("policy/action",),
}


def access_control(services: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """The hub's table for `services` (service -> its nodes): everything that is not allowed is denied."""
    rules, subjects, policies = [], [], []

    def allow(service: str, publish: list[str], hear: list[str]) -> None:
        for what, message, flow, keys in (
            ("in", "put", "ingress", publish),
            ("out", "put", "egress", hear),
            ("sub", "declare_subscriber", "ingress", hear),
            ("wanted", "declare_subscriber", "egress", publish),  # a publisher that hears of no reader stays silent
        ):
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
        own = [f"{service}-{what}" for what in ("in", "out", "sub", "wanted")]
        policies.append({"rules": [*own, "clock"], "subjects": [service]})

    everything = [TOPIC + topic for topic in TOPICS]
    rules.append({
        "id": "clock", "messages": ["query", "reply"], "flows": ["ingress", "egress"], "key_exprs": [CLOCK],
        "permission": "allow",
    })  # fmt: skip
    for service, nodes in services.items():
        outputs = {t for node in nodes for t in OUTPUTS[node]}
        if "vehicle_link" in nodes and any("vehicle_device" in others for others in services.values()):
            outputs.discard("truth/vehicle")  # it stands for the truth only where nothing else tells it
        if "car_link" in nodes and any("car_device" in others for others in services.values()):
            outputs.discard("truth/board")  # the same
        if "camera" in nodes and any("detector" in others for others in services.values()):
            outputs.discard("board/detection")  # it sees the board only where nobody looks at its pictures
        publish = sorted({TOPIC + t for t in outputs} | {TOPIC + "event", HEALTH + service})
        hear = sorted({TOPIC + t for t in TOPICS for node in nodes if may_read(node, t)} | {CONTROL})
        allow(service, publish, hear)
    for observer in OBSERVERS:
        say = [HEALTH + observer, *([CONTROL, TOPIC + "event"] if observer == "supervisor" else [])]
        allow(observer, say, [*everything, HEALTH + "*", CONTROL])
    return {
        "enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies,
    }  # fmt: skip
