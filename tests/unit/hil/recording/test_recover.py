import json
import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest

from hil.recording.reader import Recording
from hil.recording.recorder import Recorder
from hil.recording.recover import RecoverError, recover
from tests.unit.hil.recording.recorded_flight import record

NOW = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return record(tmp_path_factory.mktemp("whole") / "run.mcap", pictures="preview")


@pytest.fixture
def run(tmp_path, whole):
    folder = tmp_path / "run"
    folder.mkdir()
    shutil.copy(whole, folder / "run.mcap")
    (folder / "manifest.json").write_text('{"state": "running"}')
    return folder


def cut(run: Path, share: float) -> bytes:
    data = (run / "run.mcap").read_bytes()
    kept = data[: int(share * len(data))]
    (run / "run.mcap").write_bytes(kept)
    return kept


def messages(path):
    return [(raw.log_ns, raw.topic, raw.data) for raw in Recording(path).raw()]


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8, 0.95])
def test_recover_keeps_every_readable_message_of_a_truncated_recording(run, whole, share):
    kept = cut(run, share)
    readable = messages(run)
    done = recover(run, NOW)
    after = Recording(run)
    assert after.complete
    assert after.faults == []
    assert messages(run) == readable
    assert done.messages == len(readable) > 0
    assert set(readable) <= set(messages(whole))
    assert done.original is not None
    assert done.original.read_bytes() == kept
    assert after.metadata == Recording(whole).metadata


def test_recovered_recording_can_be_read_by_other_tools(run):
    from mcap.reader import make_reader

    cut(run, 0.6)
    done = recover(run, NOW)
    with (run / "run.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == done.messages
        assert sum(1 for _ in reader.iter_messages()) == done.messages


def test_recover_notes_itself_in_the_manifest_and_ends_the_running_state(run):
    cut(run, 0.5)
    recover(run, NOW)
    manifest = json.loads((run / "manifest.json").read_text())
    assert manifest["state"] == "interrupted"
    assert manifest["recovered"]["original"] == "run.truncated.mcap"
    assert manifest["recovered"]["utc"] == "2026-01-02T03:04:05+00:00"
    assert manifest["recovered"]["faults"]


def test_recover_does_not_change_a_complete_recording(run):
    before = (run / "run.mcap").read_bytes()
    done = recover(run, NOW)
    assert (done.original, done.faults) == (None, ())
    assert (run / "run.mcap").read_bytes() == before
    assert json.loads((run / "manifest.json").read_text()) == {"state": "running"}


def test_recover_skips_a_damaged_block(run):
    data = bytearray((run / "run.mcap").read_bytes())
    middle = len(data) // 2
    data[middle : middle + 200] = bytes(200)
    (run / "run.mcap").write_bytes(data)
    readable = Recording(run)
    count = sum(readable.counts().values())
    assert readable.faults
    assert recover(run, NOW).messages == count


def test_recover_never_overwrites_the_original(run, whole):
    first = cut(run, 0.8)
    recover(run, NOW)
    second = cut(run, 0.7)
    done = recover(run, NOW)
    assert (run / "run.truncated.mcap").read_bytes() == first
    assert done.original == run / "run.truncated-2.mcap"
    assert (run / "run.truncated-2.mcap").read_bytes() == second


def test_recover_refuses_a_run_still_being_written(tmp_path, run):
    (run / "run.mcap").unlink()
    with Recorder(run / "run.mcap"), pytest.raises(RecoverError, match="has it open"):
        recover(run, NOW)


@pytest.mark.parametrize(
    ("content", "message"), [(b"", "is empty"), (b"rubbish" * 100, "no MCAP"), (None, "cannot be read")]
)
def test_recover_refuses_a_file_that_is_not_a_recording_without_changes(run, content, message):
    (run / "run.mcap").unlink()
    if content is not None:
        (run / "run.mcap").write_bytes(content)
    before = sorted(path.name for path in run.iterdir())
    with pytest.raises(RecoverError, match=message):
        recover(run, NOW)
    assert sorted(path.name for path in run.iterdir()) == before


def test_recover_refuses_a_recording_without_a_readable_message(run):
    data = (run / "run.mcap").read_bytes()
    (run / "run.mcap").write_bytes(data[:6000])
    with pytest.raises(RecoverError, match="not one message"):
        recover(run, NOW)


def test_recover_refuses_a_folder_without_a_run(tmp_path):
    with pytest.raises(RecoverError, match="no run folder"):
        recover(tmp_path, NOW)
    with pytest.raises(RecoverError, match="no such run"):
        recover(tmp_path / "gone", NOW)
