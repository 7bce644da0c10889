import pytest

from hil.contract.graph import GraphError, check_graph
from hil.contract.topics import EVERYONE, TOPICS, may_read
from hil.nodes.belief import BeliefNode, MocapBeliefNode
from hil.nodes.detector import Detector
from hil.nodes.policy import PolicyNode
from tests.unit.hil.contract.node_fakes import FakeNode

ALL = FakeNode("everything else", outputs=tuple(TOPICS))
CAR_TRUTH = [topic for topic in TOPICS if topic.startswith(("truth/", "mocap/", "car/"))]


def test_the_contract_has_topics_with_the_cars_truth():
    assert {"truth/board", "mocap/board", "car/reference", "car/feedback"} <= set(CAR_TRUTH)


@pytest.mark.parametrize("topic", CAR_TRUTH)
@pytest.mark.parametrize("node", [PolicyNode, BeliefNode, Detector])
def test_policy_belief_and_detector_may_not_read_the_truth_of_the_car(node, topic):
    spy = FakeNode(node.name, inputs=(*node.inputs, topic))
    with pytest.raises(GraphError, match=f"'{node.name}' may not read '{topic}'"):
        check_graph([ALL, spy])


@pytest.mark.parametrize("node", [PolicyNode, BeliefNode, Detector])
def test_policy_belief_and_detector_read_only_their_allowed_topics(node):
    check_graph([ALL, FakeNode(node.name, inputs=node.inputs, wakes=node.wakes)])


@pytest.mark.parametrize("topic", TOPICS)
def test_only_the_readers_of_the_table_may_read_a_topic(topic):
    readers = TOPICS[topic].readers
    for reader in {"policy", "referee", "vehicle_link", "car_follower", "another node"}:
        graph = [ALL, FakeNode(reader, inputs=(topic,))]
        if reader in readers or readers == EVERYONE:
            check_graph(graph)
        else:
            with pytest.raises(GraphError, match="may not read"):
                check_graph(graph)


def test_node_with_a_name_similar_to_a_reader_may_not_read():
    """A node cannot get at the truth by a name that only looks like a reader's."""
    for name in ("camera ", "Camera", "camera/policy", "", "*"):
        assert not may_read(name, "truth/board")


@pytest.mark.parametrize(
    ("nodes", "words"),
    [
        ([FakeNode("a", outputs=("bord/detection",))], "'a' names topic 'bord/detection'"),
        ([FakeNode("a", inputs=("beleif",))], "'a' names topic 'beleif'"),
        ([FakeNode("a", outputs=("belief",)), FakeNode("b", outputs=("belief",))], "both 'a' and 'b'"),
        (
            [ALL, FakeNode("policy", inputs=("car/reference",))],
            "may not read 'car/reference': the contract allows no node",
        ),
        ([ALL, FakeNode("policy", inputs=("truth/vehicle",))], "the contract allows vehicle_device, camera, mocap"),
        ([FakeNode("policy", inputs=("belief",))], "'policy' reads 'belief', which no node of this graph publishes"),
        ([ALL, FakeNode("policy", inputs=("belief",), wakes=("run/stage",))], "wakes on 'run/stage' without reading"),
    ],
)
def test_a_graph_that_cannot_run_is_refused_with_its_reason(nodes, words):
    with pytest.raises(GraphError, match=words):
        check_graph(nodes)


def test_several_nodes_may_publish_events():
    check_graph([FakeNode("a", outputs=("event",)), FakeNode("b", outputs=("event",))])


def test_belief_reads_motion_capture_of_the_board_only_where_the_policy_may_know_it():
    node = FakeNode(MocapBeliefNode.name, inputs=MocapBeliefNode.inputs, wakes=MocapBeliefNode.wakes)
    with pytest.raises(GraphError, match="'belief' may not read 'mocap/board'"):
        check_graph([ALL, node])
    check_graph([ALL, node], "mocap")


@pytest.mark.parametrize("topic", [topic for topic in CAR_TRUTH if topic != "mocap/board"])
@pytest.mark.parametrize("name", ["belief", "policy", "detector"])
def test_motion_capture_opens_nothing_else_of_the_cars_truth(name, topic):
    assert not may_read(name, topic, "mocap")
    assert not may_read("policy", "mocap/board", "mocap")
