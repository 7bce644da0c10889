"""Faults of a scenario in real time: they act on the processes and wires of a live run, and the flight has a class."""

import pytest

from hil.assembly.plan import Plan
from hil.live.run import fly_live
from hil.recording import provenance
from hil.recording.reader import Recording
from hil.scoring.flight_class import ABORTED
from scenarios.spec import FOLDER

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(300), pytest.mark.usefixtures("real_time")]


def flown(tmp_path, fault):
    """The flight of a scenario with the `[[fault]]` table of these lines, and (s, text) of the fault's events."""
    path = tmp_path / "faulty.toml"
    path.write_text((FOLDER / "simple_ii.toml").read_text() + "\n[[fault]]\n" + "\n".join(fault) + "\n")
    names = {"scenario": str(path), "rig": "sim", "policy": None, "camera": "model"}
    flight = fly_live(
        Plan(**names, live=True), names, 0, pictures="none", out=tmp_path / "runs", code=provenance.code(),
        progress=lambda *_: None,
    ).flight  # fmt: skip
    recording = Recording(flight.run.recording)
    events = [(entry.log_ns, entry.message.text) for entry in recording.messages(["event"])]
    return flight, recording, [(log_ns, text) for log_ns, text in events if text.startswith("fault ")]


def test_process_that_is_killed_by_a_fault_ends_the_attempt_and_the_vehicle_lands(tmp_path):
    flight, _, events = flown(tmp_path, ['kind = "service.killed"', "at = 0.3"])
    assert flight.failure.startswith("brain was killed by SIGKILL")
    assert flight.flight_class is not None and flight.flight_class.name == ABORTED, flight.flight_class
    assert flight.flight_class.not_begun == () and "fault service.killed begins" in [text for _, text in events]


def test_link_that_is_down_for_a_while_hands_the_vehicle_to_its_failsafe(tmp_path):
    flight, _, events = flown(tmp_path, ['kind = "mavlink.down"', "at = 0.3", "for = 0.6"])
    assert [text for _, text in events] == ["fault mavlink.down begins", "fault mavlink.down ends"]
    assert flight.flight_class is not None and flight.flight_class.name == ABORTED, flight.flight_class


def test_process_that_is_stopped_for_a_while_goes_on(tmp_path):
    flight, recording, events = flown(
        tmp_path, ['kind = "service.stopped"', "at = 'stage == \"lead\"'", "for = 0.2", 'service = "camera"']
    )
    (_, begins), (ended_ns, ends) = events
    assert (begins, ends) == ("fault service.stopped begins", "fault service.stopped ends")
    assert "camera" not in flight.failure
    assert any(entry.log_ns > ended_ns for entry in recording.messages(["board/detection"]))
