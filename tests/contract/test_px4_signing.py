"""MAVLink 2 signing from end to end: a whole flight signed both ways, and nothing at all without the right key."""

import json
from datetime import UTC, datetime

import pytest

from hil.assembly.builder import Assembly
from hil.assembly.rig import Rig, VehicleSlot
from hil.assembly.twin import simulated_twin
from hil.contract.node import Inbox
from hil.contract.wire import memory_pair
from hil.recording.provenance import code
from hil.recording.runs import new_run, policy_identity
from scenarios.draw import draw
from scenarios.spec import load
from tests.contract.signed_wire import SignedWire
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import LinkConfig, Rates, Signing
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import load_airframe

MS = 1_000_000
KEY = bytes(range(32))
UNIX_NS = 1_795_000_000_000_000_000  # some day in 2026
STAMP = (UNIX_NS - 1_420_070_400_000_000_000) // 10_000
START = (0.0, 0.0, 2.5, 0.0)


class Flight:
    """Driver and software PX4 with a judge of signatures between them."""

    def __init__(self, ours=KEY, theirs=KEY, demands=True):
        self.now, self.notes = 0, []
        near, far = memory_pair(lambda: self.now, MS)
        self.judge = SignedWire(far, theirs, STAMP) if demands else far
        frame = load_airframe("paper_quad")
        self.sim = Px4Sim({"api": self.judge}, frame, 3)
        signing = Signing(key=ours, epoch_ns=UNIX_NS) if ours else None
        self.link = Px4Link(near, LinkConfig(start=START, hover_thrust=frame.hover_thrust, signing=signing, tries=3))

    def run(self, seconds, until=lambda: False, command=None):
        end = self.now + round(seconds * 1e9)
        while self.now < end and not until():
            self.sim.step(self.now)
            out = self.link.step(self.now, command if self.now % (8 * MS) == 0 else None)
            self.notes += [note.text for note in out.notes]
            self.now += 4 * MS
        return self

    def reported(self, part):
        return any(part in text for text in self.notes)


def test_signed_flight_is_accepted_in_both_directions():
    flight = Flight()
    flight.run(40.0, until=lambda: flight.link.phase == "hover")
    assert flight.link.phase == "hover", flight.notes[-4:]
    flight.run(0.5, command=Rates((0.0, 0.0, 0.5), 9.80665))
    assert flight.sim.truth().body_rate[2] == pytest.approx(0.5, abs=0.1)
    assert {"SET_ATTITUDE_TARGET", "COMMAND_LONG", "PARAM_SET", "TIMESYNC"} <= set(flight.judge.accepted)
    flight.link.release()
    flight.run(20.0, until=lambda: not flight.sim.truth().armed)
    assert not flight.sim.truth().armed
    assert (flight.judge.refused, flight.link.counters["unsigned_frames"]) == (0, 0)


def test_autopilot_that_requires_signatures_ignores_an_unsigned_link():
    flight = Flight(ours=None).run(12.0)
    assert flight.judge.accepted == []
    assert flight.judge.refused > 5
    assert flight.link.phase == "failed"
    assert flight.reported("the autopilot answers no request for a parameter")
    assert flight.reported("the autopilot signs its messages and this link has no key")
    assert not flight.sim.truth().armed


def test_frames_with_another_key_are_ignored_both_ways():
    flight = Flight(ours=bytes(range(1, 33))).run(12.0)
    assert flight.judge.accepted == []
    assert flight.link.phase == "connect"
    assert flight.link.counters["unsigned_frames"] > 100
    assert flight.reported("frames without a valid signature were refused")


def test_unsigned_autopilot_is_ignored():
    flight = Flight(demands=False).run(12.0)
    assert flight.link.phase == "connect"
    assert flight.link.counters["unsigned_frames"] > 100


def test_replayed_signed_command_is_ignored():
    flight = Flight()
    overheard = []
    send = flight.link._wire.send
    flight.link._wire.send = lambda data: (overheard.append(data), send(data))
    flight.run(5.0)
    before = flight.judge.refused
    for data in overheard[:20]:
        send(data)
    flight.now += 4 * MS
    flight.judge.receive()
    assert flight.judge.refused == before + 20


# the rig's key


class NoWires:
    """A wire that leads nowhere, and keeps what goes into it."""

    def __init__(self):
        self.sent = []

    def vehicle_system(self):
        return 1

    def vehicle_link(self):
        return self

    def send(self, data):
        self.sent.append(data)

    def receive(self):
        return []


def rig(path):
    return Rig(title="signed", vehicle=VehicleSlot(kind="mavlink", url="udp://:14540", signing_key=str(path)))


def link(path, scenario, drawn):
    wires = NoWires()
    node = Assembly(scenario, rig(path), drawn, lambda: None, wires, unix_ns=UNIX_NS).node("vehicle_link")
    return node, wires


@pytest.fixture
def case():
    scenario = load("simple-i")
    return scenario, draw(scenario, 0)


def test_key_file_of_the_rig_signs_and_is_not_recorded(tmp_path, case):
    path = tmp_path / "vehicle.key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    node, wires = link(path, *case)
    node.step(0, Inbox(node.inputs))
    assert wires.sent
    assert all(frame[2] & 1 for frame in wires.sent), "every frame carries a signature"
    run = new_run(
        tmp_path / "runs", scenario={"name": "simple-i"}, rig=rig(path).model_dump(mode="json"), seed=0, host="live",
        policy=policy_identity("planner"), simulated=False, started_utc=datetime.now(UTC), code=code(), more={},
    )  # fmt: skip
    kept = json.dumps(run.manifest) + repr(node._link._config) + simulated_twin(rig(path)).model_dump_json()
    assert str(path) in kept
    for form in (KEY.hex(), repr(KEY), str(list(KEY))):
        assert form not in kept


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "the signing key cannot be read"),
        (b"short", "has 32 bytes"),
        (bytes(32), "zeros only is not secret"),
    ],
)
def test_invalid_key_raises_before_the_first_frame_is_sent(tmp_path, case, content, expected):
    path = tmp_path / "vehicle.key"
    if content is not None:
        path.write_bytes(content)
        path.chmod(0o600)
    with pytest.raises(ValueError, match=expected):
        link(path, *case)


@pytest.mark.parametrize("mode", [0o666, 0o644, 0o640, 0o602])
def test_key_file_open_to_other_users_is_refused(tmp_path, case, mode):
    path = tmp_path / "vehicle.key"
    path.write_bytes(KEY)
    path.chmod(mode)
    with pytest.raises(ValueError, match=f"mode {mode:04o}.*chmod 600"):
        link(path, *case)
