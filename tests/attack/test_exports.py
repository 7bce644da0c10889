"""A damaged recording as a ROS 2 bag: refused in one line, or written whole with what can be read; nothing half."""

import pytest

from hil.contract.topics import TOPICS
from hil.recording.foxglove import FoxgloveView
from hil.recording.reader import ReadError
from hil.recording.recorder import Recorder
from tests.attack.forged import FACTOR, message, rng
from tests.unit.hil.recording.recorded_flight import record

pytest.importorskip("rosbags", reason="the extra ros2 is not installed")

from rosbags.highlevel import AnyReader

from hil.ros2.bag import export
from hil.ros2.types import typestore


def damaged(random, data):
    """The bytes with some of them changed, cut out or missing at the end."""
    data = bytearray(data)
    kind = random.randrange(3)
    if kind == 0:
        for _ in range(random.randrange(1, 40)):
            data[random.randrange(len(data))] = random.randrange(256)
    elif kind == 1:
        del data[random.randrange(len(data)) :]
    else:
        at = random.randrange(len(data))
        del data[at : at + random.randrange(1, 5000)]
    return bytes(data)


def test_damaged_recording_is_exported_whole_or_not_at_all(tmp_path):
    random, whole = rng("export"), record(tmp_path / "whole.mcap", pictures="preview", seconds=0.2).read_bytes()
    written = 0
    for case in range(12 * FACTOR):
        path, out = tmp_path / f"{case}.mcap", tmp_path / f"bag{case}"
        path.write_bytes(damaged(random, whole))
        try:
            export(path, out)
        except ReadError as error:
            assert not out.exists() and "\n" not in str(error)
        else:
            written += 1
            with AnyReader([out], default_typestore=typestore()) as reader:
                for connection, _, data in reader.messages():
                    reader.deserialize(data, connection.msgtype)
        path.unlink()
        assert not [one.name for one in tmp_path.iterdir() if one.name.startswith(".")]
    assert written


@pytest.mark.parametrize("pictures", ["preview", "raw"])
def test_messages_that_mean_nothing_are_left_out_and_the_rest_kept(tmp_path, pictures):
    random, now = rng(f"forged export {pictures}"), 0
    topics = [topic for topic, row in TOPICS.items() if row.recorded]
    with Recorder(tmp_path / "run.mcap", view=FoxgloveView(pictures=pictures)) as recorder:
        for _ in range(15 * FACTOR):
            for topic in topics:
                now += 1_000_000
                recorder(now, topic, message(TOPICS[topic].message, random))
    counts = export(tmp_path / "run.mcap", tmp_path / "bag")
    assert counts["/truth/vehicle"] == counts["/car/command"] == 15 * FACTOR
    with AnyReader([tmp_path / "bag"], default_typestore=typestore()) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
