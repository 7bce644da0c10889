"""The access list of the hub agrees with the contract: an identity has only the rights of its nodes."""

import pytest

from hil.assembly.builder import Assembly
from hil.assembly.node_table import node_names, service_nodes
from hil.assembly.plan import Plan
from hil.assembly.simulation import MemoryWires
from hil.bus.keys import access_control
from hil.bus.leaf import CONTROL, EVENT, TOPIC
from hil.contract.topics import published_by
from scenarios.draw import draw

PLAN = Plan("simple-i", "sim", None, "model")


def rules():
    table = access_control(service_nodes(PLAN.rig))
    return table, {rule["id"]: set(rule["key_exprs"]) for rule in table["rules"]}


def test_access_rules_deny_by_default():
    table, _ = rules()
    assert table["enabled"]
    assert table["default_permission"] == "deny"
    assert all(rule["permission"] == "allow" for rule in table["rules"])


@pytest.mark.parametrize("kind", ["out", "sub"])
def test_policy_identity_may_not_read_the_truth_of_the_car(kind):
    _, keys = rules()
    assert {TOPIC + "belief", TOPIC + "vehicle/odometry"} <= keys[f"brain-{kind}"]
    assert not {TOPIC + "truth/board", TOPIC + "mocap/board", TOPIC + "car/command"} & keys[f"brain-{kind}"]
    assert {key for key in keys[f"brain-{kind}"] if "*" in key} == {EVENT + "*"}


def test_keys_allow_commands_only_to_policy_and_sent_only_to_gate():
    _, keys = rules()
    for topic, service in (("policy/action", "brain"), ("vehicle/sent", "vehicle_link"), ("car/command", "car")):
        assert [name for name, allowed in keys.items() if name.endswith("-in") and TOPIC + topic in allowed] == [
            f"{service}-in"
        ]
    assert [name for name, allowed in keys.items() if name.endswith("-in") and CONTROL in allowed] == ["supervisor-in"]


def test_identity_publishes_events_on_its_own_key_only():
    _, keys = rules()
    for service in (*service_nodes(PLAN.rig), "supervisor"):
        assert {key for key in keys[f"{service}-in"] if key.startswith(TOPIC + "event")} == {EVENT + service}


def test_truth_has_one_source_while_the_vehicle_is_simulated():
    _, keys = rules()
    assert TOPIC + "truth/vehicle" in keys["vehicle_device-in"]
    assert TOPIC + "truth/vehicle" not in keys["vehicle_link-in"]
    assert TOPIC + "truth/board" not in keys["car-in"]


def test_every_node_may_publish_its_topics_of_the_contract():
    twin = Assembly(PLAN.scenario, PLAN.rig, draw(PLAN.scenario, 0), PLAN.make_policy, MemoryWires(PLAN.rig, lambda: 0))
    for name in twin.names:
        node = twin.node(name)
        assert set(node.outputs) - {"event"} <= published_by(name, node_names(PLAN.rig))
        node.close()


def test_access_list_lets_the_belief_receive_motion_capture_where_the_policy_may_know_it():
    table = access_control(service_nodes(PLAN.rig), "mocap")
    keys = {rule["id"]: set(rule["key_exprs"]) for rule in table["rules"]}
    for kind in ("out", "sub"):
        assert TOPIC + "mocap/board" in keys[f"brain-{kind}"]
        assert not {TOPIC + "truth/board", TOPIC + "mocap/vehicle", TOPIC + "car/command"} & keys[f"brain-{kind}"]
