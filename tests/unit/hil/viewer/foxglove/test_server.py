"""Foxglove's server: the channels of a recording, read by a client; it only sends, and waits for no client."""

import base64
import json
import re
import threading
import time
from dataclasses import asdict

import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from hil.contract import messages as m
from hil.contract.codec import codec
from hil.contract.topics import TOPICS
from hil.recording.foxglove import FoxgloveView
from hil.recording.reader import Recording
from hil.viewer.foxglove.live import LAYOUT, FoxgloveProcess
from hil.viewer.foxglove.server import FoxgloveServer
from hil.viewer.foxglove.spec import ServerSpec
from hil.viewer.view import ViewerError, free_port
from tests.unit.hil.recording.recorded_flight import flight, record
from tests.unit.hil.viewer.foxglove.foxglove_client import Client
from vehicle.camera.lens import Lens
from vehicle.camera.pinhole import Camera

CHANNELS = len([t for t, row in TOPICS.items() if row.recorded and t != "camera/image"]) + len(FoxgloveView.CHANNELS)
LIMIT_S = 60.0


@pytest.fixture
def server():
    serving = FoxgloveServer(0, FoxgloveView(pictures="preview"), "a flight")
    yield serving
    serving.close()


@pytest.fixture
def client(server):
    with Client(server.port) as joined:
        joined.welcome(CHANNELS)
        yield joined


def subscribed(server, client, *topics):
    """Subscribe, and wait until the server knows of it."""
    client.subscribe(*topics)
    end = time.monotonic() + LIMIT_S
    channels = {f"/perch/{t}": c for t, c in server._channels.items()} | server._views
    while not all(channels[topic].has_sinks() for topic in topics):
        assert time.monotonic() < end, "not subscribed"
        time.sleep(0.01)


def test_channels_are_those_of_the_recording(client, tmp_path):
    recorded = Recording(record(tmp_path / "run.mcap", pictures="preview", seconds=0.5)).topics
    assert {topic: one["schemaName"] for topic, one in client.channels.items()} == recorded
    for one in client.channels.values():
        assert one["encoding"] == one["schemaEncoding"] == "protobuf"
        FileDescriptorSet.FromString(base64.b64decode(one["schema"]))


def test_client_reads_what_was_recorded(server, client, tmp_path):
    path = record(tmp_path / "run.mcap", seconds=1.0)
    subscribed(server, client, "/perch/truth/vehicle", "/perch/belief", "/vehicle/pose")
    expected = []
    for entry in Recording(path).messages():
        server.show(entry.log_ns, entry.topic, entry.message)
        if entry.topic in ("truth/vehicle", "belief"):
            expected.append(entry)
    got = []
    while len(got) < len(expected):
        data = client.data()
        if data.topic.startswith("/perch/"):
            topic = data.topic.removeprefix("/perch/")
            got.append((data.time_ns, topic, codec(TOPICS[topic].message).decode(data.payload)))
    assert got == [(entry.log_ns, entry.topic, entry.message) for entry in expected]


def test_pictures_come_as_jpeg_and_boxes_again_for_a_late_client(server, client):
    for entry in flight(1.5):
        server.show(*entry)  # nobody looks yet
    subscribed(server, client, "/scene", "/camera/image")
    for now, topic, message in flight(3.0):
        if now > 1_500_000_000:
            server.show(now, topic, message)
    boxes, pictures = set(), 0
    while len(boxes) < 3 or pictures < 5:
        data = client.data()
        if data.topic == "/scene":
            boxes |= {entity.id for entity in SceneUpdate.FromString(data.payload).entities}
        else:
            assert CompressedImage.FromString(data.payload).format == "jpeg"
            pictures += 1
    assert boxes == {"vehicle", "board", "board_belief"}


def test_client_can_change_nothing(client):
    assert not {"clientPublish", "parameters", "services", "playbackControl"} & set(client.info["capabilities"])


def test_hanging_client_does_not_block_the_server(server, client):
    subscribed(server, client, "/perch/truth/vehicle")
    message = next(one for _, topic, one in flight(0.1) if topic == "truth/vehicle")
    for step in range(100_000):  # it reads nothing: a call that waited would never come back
        server.show(step, "truth/vehicle", message)
    assert server.shown == 100_000


def test_what_cannot_be_shown_is_counted(server):
    bad = m.BoardState(2**70, (0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    server.show(-5, "truth/board", bad)
    assert server.not_shown == 1 and server.shown == 0


SPEC = ServerSpec(0, "tcp/127.0.0.1:1", "", "a flight", 0.42, asdict(Camera(lens=Lens("fisheye", (0.1,) * 4))))


def test_camera_survives_the_way_to_the_process():
    again = ServerSpec(**json.loads(json.dumps(asdict(SPEC))))
    assert again.calibrated() == Camera(lens=Lens("fisheye", (0.1,) * 4))


def test_process_serves_a_run_of_the_bus_and_tells_what_it_dropped():
    pytest.importorskip("zenoh")
    from hil.bus.leaf import Bus, open_hub

    endpoint = f"tcp/127.0.0.1:{free_port()}"
    process = FoxgloveProcess(ServerSpec(**{**asdict(SPEC), "endpoint": endpoint}))
    with process, open_hub(endpoint), Bus(endpoint) as bus, Client(process.port) as client:
        client.welcome(CHANNELS)
        client.subscribe("/perch/belief", "/vehicle/pose")
        running, seen = threading.Event(), set()

        def fly():
            steps = ((now + lap * 2 * 10**9, topic, one) for lap in range(10**6) for now, topic, one in flight(2.0))
            while not running.is_set():
                bus.publish(*next(steps))
                time.sleep(1e-4)

        flying = threading.Thread(target=fly)
        flying.start()
        try:
            while seen != {"/perch/belief", "/vehicle/pose"}:  # a run that goes on until enough was shown
                seen.add(client.data().topic)
        finally:
            running.set()
            flying.join()
    assert process.process.returncode == 0 and process.dropped >= 0


def test_port_in_use_is_told_in_one_line(server):
    with pytest.raises(ViewerError, match=f"port {server.port} of 127.0.0.1 cannot be listened on") as found:
        FoxgloveProcess(ServerSpec(**{**asdict(SPEC), "port": server.port}))
    assert found.value.code == 3 and "\n" not in str(found.value)


def paths(layout):
    for name, panel in layout["configById"].items():
        yield from ((name, one["value"]) for one in panel.get("paths", ()))


def test_layout_asks_for_topics_and_fields_that_there_are():
    layout = json.loads(LAYOUT.read_text())
    views = {topic for topic, _, _ in FoxgloveView.CHANNELS}
    for name, path in paths(layout):
        topic, field = re.fullmatch(r"/perch/([a-z/]+)\.(\w+)(?:\[\d\])?", path).groups()
        assert field in TOPICS[topic].message.__dataclass_fields__, (name, path)
    shown = layout["configById"]
    assert set(shown["3D!perching"]["topics"]) <= views and shown["Log!events"]["topicToRender"] in views
    image = shown["Image!picture"]["imageMode"]
    assert {image["imageTopic"], image["calibrationTopic"], *image["annotations"]} <= views

    def panels(node):
        return {node} if isinstance(node, str) else panels(node["first"]) | panels(node["second"])

    assert panels(layout["layout"]) == set(shown)
