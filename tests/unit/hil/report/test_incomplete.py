"""Reports of incomplete recordings: missing parts are named, the rest is shown."""

import json
import shutil

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from hil.contract.codec import codec
from hil.contract.topics import TOPICS
from hil.recording.mcap_writer import McapWriter
from hil.recording.reader import ReadError, Recording
from hil.recording.recorder import PREFIX
from hil.recording.runs import RunError
from hil.report import page
from hil.report.recorded.flight import load
from hil.report.write import write_report
from tests.unit.hil.report.pages import Page


def cut(run, keep):
    data = (run / "run.mcap").read_bytes()
    (run / "run.mcap").write_bytes(data[: int(len(data) * keep)])


def without(run, *topics):
    """Write the recording again without `topics`."""
    recording = Recording(run)
    scratch = run / "new.mcap"
    writer = McapWriter(scratch)
    wanted = [t for t in recording.topics if t.startswith(PREFIX) and t[len(PREFIX) :] not in topics]
    kinds = {t: codec(TOPICS[t[len(PREFIX) :]].message) for t in wanted}
    channels = {t: writer.channel(t, kind.name, kind.schema) for t, kind in kinds.items()}
    for raw in recording.raw(wanted):
        writer.add(channels[raw.topic], raw.log_ns, raw.data)
    writer.close()
    scratch.replace(run / "run.mcap")


def test_truncated_recording_without_a_score(copied):
    cut(copied, 0.55)
    (copied / "score.json").unlink()
    report = Page(page.render([load(copied)]))
    assert report.text.index("The recording is incomplete") < report.text.index("No verdict")
    assert "the run ended before the referee decided" in report.text
    assert "Nearest approach" in report.text and "The recording ends before a touchdown" in report.text
    assert "attached – yes within tolerance – no" in report.text  # not known, beside the published flight
    assert {"rho", "speed", "thrust"} <= {p["key"] for p in report.data["plots"]}
    assert report.data["flights"][0]["decided"] is None


def test_truncated_recording_with_a_score_keeps_the_verdict(copied):
    cut(copied, 0.55)
    report = Page(page.render([load(copied)]))
    assert "The recording is incomplete" in report.text
    assert "Perched" in report.text
    assert "verdict from score.json" in report.text


@settings(max_examples=12)
@given(keep=st.floats(0.0, 1.0))
def test_recording_cut_anywhere_gives_a_report_or_a_one_line_error(golden, tmp_path_factory, keep):
    run = shutil.copytree(golden, tmp_path_factory.mktemp("cut") / "run")
    cut(run, keep)
    try:
        html = page.render([load(run)])
    except (ReadError, RunError) as error:
        assert "\n" not in str(error)
    else:
        Page(html)


LOST = {
    "truth/board mocap/board": [
        "touchdown close-up",
        "motion of the board",
        "errors of the board's estimate",
    ],
    "belief": ["reliability rho", "errors of the board's estimate"],
    "policy/action": ["commands asked by the policy", "exposure to action, histogram"],
    "vehicle/sent": ["commands sent after the gate"],
    "board/detection": ["tags a picture, perception rate", "exposure to detection", "errors of single detections"],
    "event": [],
    "truth/vehicle mocap/vehicle": ["errors of the odometry"],
    "truth/vehicle mocap/vehicle vehicle/odometry": ["plan and side view", "touchdown close-up"],
    "car/reference car/command car/feedback": ["the car's reference speed", "the car's commanded speed"],
}


@pytest.mark.parametrize("topics", LOST)
def test_missing_topic_is_named_with_its_missing_plots(copied, topics):
    without(copied, *topics.split())
    report = Page(page.render([load(copied)]))
    listed = report.text[report.text.rindex("What is missing") : report.text.index("Provenance identity")]
    for topic in topics.split():
        assert topic in listed
    for plot in LOST[topics]:
        assert plot in listed


def test_report_uses_motion_capture_without_truth(copied):
    without(copied, "truth/vehicle", "truth/board")
    report = Page(page.render([load(copied)]))
    assert "mocap/vehicle and mocap/board" in report.text
    assert "speed" in {p["key"] for p in report.data["plots"]}


def test_report_of_any_single_topic_is_written(golden, tmp_path):
    for topic in TOPICS:
        run = shutil.copytree(golden, tmp_path / topic.replace("/", "-"))
        without(run, *(t for t in TOPICS if t != topic))
        try:
            recorded = load(run)
        except (ReadError, RunError) as error:
            assert topic in ("camera/image", "run/fault"), error  # of which the golden run has none
        else:
            Page(page.render([recorded]))


def test_report_of_a_recording_without_a_run_folder_is_written(golden, tmp_path):
    shutil.copy(golden / "run.mcap", tmp_path / "found.mcap")
    report = Page(page.render([load(tmp_path / "found.mcap")]))
    assert "no manifest beside this recording" in report.text
    assert "Perched" in report.text
    assert "origin unknown" in report.text


def test_report_accepts_a_manifest_of_another_version(copied):
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["scenario"] = {"name": "simple-ii", "from": "the future"}
    (copied / "manifest.json").write_text(json.dumps(manifest))
    report = Page(page.render([load(copied)]))
    assert "the manifest's scenario is not one of this version" in report.text
    assert "Perched" in report.text


def test_parameters_that_are_not_default_are_listed(copied):
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["scenario"]["tolerance"]["distance"] = 0.15
    manifest["rig"]["camera"]["transport_ms"] = 40.0
    manifest["autopilot"] = {"parameters": {"COM_OF_LOSS_T": 0.3, "SYS_HAS_MAG": 1, "MINE": 7}}
    (copied / "manifest.json").write_text(json.dumps(manifest))
    text = Page(page.render([load(copied)])).text
    assert "tolerance.distance 0.15 0.2" in text
    assert "camera.transport_ms 40.0 15.0" in text
    assert "COM_OF_LOSS_T 0.3 1.0" in text and "MINE 7.0 no such parameter" in text
    default = text[text.index("Autopilot parameters that are not default") : text.index("all 3 parameters")]
    assert "SYS_HAS_MAG" not in default and "SYS_HAS_MAG 1.0" in text


def test_report_states_missing_autopilot_parameters(copied):
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest.pop("autopilot", None)
    (copied / "manifest.json").write_text(json.dumps(manifest))
    without(copied, "vehicle/parameters")
    assert "which were not default is unknown" in Page(page.render([load(copied)])).text


def foreign(path):
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("other", "jsonschema", b"{}")
        channel = writer.register_channel("/imu", "json", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()


def empty(path):
    path.write_bytes(b"")


def garbage(path):
    path.write_bytes(b"this is a text file" * 50)


@pytest.mark.parametrize(("make", "why"), [(foreign, "not a recording"), (empty, "is empty"), (garbage, "no MCAP")])
def test_file_that_is_not_a_recording_is_a_one_line_error(tmp_path, make, why):
    make(tmp_path / "x.mcap")
    with pytest.raises(ReadError, match=why) as caught:
        write_report([tmp_path / "x.mcap"])
    assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["x.mcap"]


def test_folder_without_a_run_is_a_one_line_error(tmp_path, copied):
    (tmp_path / "nothing-here").mkdir()
    with pytest.raises(RunError, match="neither a run folder"):
        write_report([tmp_path / "nothing-here"])
    with pytest.raises(RunError, match="no such run"):
        write_report([tmp_path / "absent"])
    (copied / "run.mcap").unlink()
    with pytest.raises(ReadError, match="cannot be read"):
        write_report([copied])


@pytest.mark.parametrize(
    ("name", "needed"),
    [
        ("manifest.json", ("scenario", "rig", "policy", "code", "packages")),
        ("score.json", ("metrics", "reasons", "attached")),
    ],
)
def test_a_damaged_table_is_left_out_and_named(copied, name, needed):
    table = json.loads((copied / name).read_text())
    for key in table:
        (copied / name).write_text(json.dumps({**table, key: None}))
        text = Page(page.render([load(copied)])).text
        if key in needed:
            assert "damaged" in text and key in text, key
    (copied / name).write_text(json.dumps({}))
    Page(page.render([load(copied)]))
