"""The graph of a live run is checked across its processes, from the description that each service publishes."""

import json

import pytest

from hil.contract.graph import GraphError
from hil.live.graph import check_live_graph, declare
from tests.unit.hil.contract.node_fakes import FakeNode

SEES = FakeNode("detector", inputs=("camera/image",), outputs=("board/detection",), wakes=("camera/image",))
LOOKS = FakeNode("camera", outputs=("camera/image",), period_ns=16_666_667)
BELIEVES = FakeNode("belief", inputs=("board/detection",), outputs=("belief",))


def health(**services):
    return {name: json.loads(json.dumps({"graph": declare(nodes)})) for name, nodes in services.items()}


def test_valid_graph_across_services_passes():
    described = health(camera=[LOOKS], detector=[SEES], brain=[BELIEVES])
    check_live_graph(described, ["camera", "detector", "brain"])


@pytest.mark.parametrize(
    ("services", "words"),
    [
        ({"camera": [LOOKS], "brain": [BELIEVES]}, "'belief' reads 'board/detection', which no node"),
        ({"camera": [LOOKS], "other": [LOOKS]}, "published by both 'camera' and 'camera'"),
        (
            {
                "brain": [FakeNode("policy", inputs=("mocap/board",))],
                "mocap": [FakeNode("m", outputs=("mocap/board",))],
            },
            "'policy' may not read 'mocap/board'",
        ),
    ],
)
def test_invalid_graph_across_services_is_refused(services, words):
    with pytest.raises(GraphError, match=words):
        check_live_graph(health(**services), list(services))


def test_graph_check_ignores_services_outside_the_run():
    described = health(camera=[LOOKS], stranger=[LOOKS])
    check_live_graph(described | {"recorder": {}}, ["recorder", "camera"])
