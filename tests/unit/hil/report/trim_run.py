"""How the golden run was made: a run of the real loop, cut to its attempt so that it is small enough to keep.

    perch-hil run simple-ii --seed 3 --out runs
    python tests/unit/hil/report/trim_run.py runs/<run> tests/data/runs/simple-ii

All messages of the contract from shortly before the attempt stay as they were; of the views for eyes only what the
report reads, and of the pictures every sixth.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from hil.contract.codec import codec
from hil.contract.topics import TOPICS
from hil.recording.foxglove import schema_set
from hil.recording.mcap_writer import McapWriter
from hil.recording.reader import Recording
from hil.recording.recorder import PREFIX
from hil.recording.runs import open_run

BEFORE_NS = 300_000_000
VIEWS = {"/tf": FrameTransforms, "/camera/calibration": CameraCalibration, "/camera/image": CompressedImage}


def trim(source: Path, target: Path) -> None:
    """Write the short form of run `source` to the new folder `target`."""
    run, recording = open_run(source), Recording(source)
    start = next(e.message.attempt_start_ns for e in recording.messages(["run/stage"]) if e.message.name == "attempt")
    target.mkdir(parents=True)
    writer, channels, seen = McapWriter(target / "run.mcap"), {}, {}
    writer.metadata("perch-hil", recording.metadata["perch-hil"])
    for topic in recording.topics:
        if topic.startswith(PREFIX):
            kind = codec(TOPICS[topic[len(PREFIX) :]].message)
            channels[topic] = writer.channel(topic, kind.name, kind.schema)
        elif topic in VIEWS:
            lane = "pictures" if topic == "/camera/image" else "small"
            name = VIEWS[topic].DESCRIPTOR.full_name
            channels[topic] = writer.channel(topic, name, schema_set(VIEWS[topic]), lane)
    for raw in recording.raw(channels):
        if raw.log_ns < start - BEFORE_NS and raw.topic != PREFIX + "vehicle/parameters":
            continue
        nth = seen[raw.topic] = seen.get(raw.topic, -1) + 1
        if (raw.topic == "/camera/image" and nth % 6) or (raw.topic in ("/tf", "/camera/calibration") and nth > 5):
            continue
        writer.add(channels[raw.topic], raw.log_ns, raw.data)
    writer.close()
    manifest = run.manifest
    manifest["machine"]["name"] = "example"
    manifest["trimmed"] = {"first_message_before_attempt_s": BEFORE_NS / 1e9, "pictures": "every sixth preview"}
    (target / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n")
    (target / "score.json").write_text(json.dumps(run.score, indent=1) + "\n")


if __name__ == "__main__":
    trim(Path(sys.argv[1]), Path(sys.argv[2]))
