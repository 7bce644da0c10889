"""A live run's nodes live in many processes; their graph is checked all the same, from what each says of itself."""

import json

import pytest

from hil.contract.graph import GraphError
from hil.live.graph import check_live_graph, declare
from tests.unit.hil.contract.node_fakes import FakeNode

SEES = FakeNode("detector", inputs=("camera/image",), outputs=("board/detection",), wakes=("camera/image",))
LOOKS = FakeNode("camera", outputs=("camera/image",), period_ns=16_666_667)
SPIES, TELLS = FakeNode("policy", inputs=("mocap/board",)), FakeNode("mocap", outputs=("mocap/board",))
BELIEVES = FakeNode("belief", inputs=("board/detection",), outputs=("belief",))


def health(**services):
    return {name: json.loads(json.dumps({"graph": declare(nodes)})) for name, nodes in services.items()}


def test_a_graph_that_fits_over_its_processes_passes():
    said = health(camera=[LOOKS], detector=[SEES], brain=[BELIEVES])
    check_live_graph(said, ["camera", "detector", "brain"])


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
def test_one_that_does_not_fit_is_refused(services, words):
    with pytest.raises(GraphError, match=words):
        check_live_graph(health(**services), list(services))


def test_a_service_outside_the_run_is_not_checked():
    said = health(camera=[LOOKS], stranger=[LOOKS])
    check_live_graph(said | {"recorder": {}}, ["recorder", "camera"])
