"""Damaged and foreign bytes into every codec and reader: each answers with its own error or a count, and none hangs."""

import dataclasses
import json
import math
import shutil
from datetime import UTC, datetime

import pytest

from groundcar.scout.codec import COMMANDS, can_id, feedback_names
from groundcar.scout.driver import Command, ScoutLink, WrongProtocolError
from groundcar.scout.sim import ScoutSim
from hil.bus.certificates import KeysError, check_keys, make_keys
from hil.bus.leaf import credentials_in
from hil.check import records
from hil.check.checklist import Checklist
from hil.check.crew_key import CrewKeyError, load_crew_key, load_public_keys
from hil.check.records import RecordError
from hil.check.session import new_record
from hil.contract import messages
from hil.contract.codec import CodecError, decode, encode
from hil.contract.wire import memory_pair
from hil.live.spec import LiveSpec
from hil.recording.reader import ReadError, Recording
from hil.recording.recover import RecoverError, recover
from hil.recording.runs import RunError, open_run
from hil.wires import WireError
from hil.wires.signing_key import read_signing_key
from hil.wires.url import check_url
from tests.attack.forged import FACTOR, FLOATS, damaged, message, rng
from tests.paths import GOLDEN_RUN
from vehicle.px4.codec import MESSAGES, Packer
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import LinkConfig
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.airframe import load_airframe

KINDS = [kind for kind in vars(messages).values() if dataclasses.is_dataclass(kind)]
STEP_NS = 4_000_000
WHEN = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_damaged_message_is_decoded_or_refused(kind):
    random = rng(kind.__name__)
    for _ in range(60 * FACTOR):
        whole = message(kind, random)
        data = encode(whole)
        assert repr(decode(kind, data)) == repr(whole)
        try:
            found = decode(kind, damaged(data, random))
        except CodecError:
            continue
        assert isinstance(found, kind)


def mavlink(random, packer):
    """One frame of any message with arbitrary fields, whole or damaged."""
    kind = MESSAGES[random.choice(NAMES)]
    size = kind.size if random.random() < 0.7 else random.randrange(1, 256)
    payload = random.choice((random.randbytes(size), bytes(size), b"\xff" * size, b"\0\0\x80\x7f" * (size // 4 + 1)))
    data = packer.pack_payload(kind, payload[: max(1, min(size, 255))])
    return damaged(data, random) if random.random() < 0.3 else data


NAMES = sorted(MESSAGES._ids)


def test_mavlink_driver_survives_any_frame():
    random = rng("driver")
    for case in range(4 * FACTOR):
        far, near = memory_pair(lambda: 0)
        link = Px4Link(near, LinkConfig(start=(0.0, 0.0, 2.0, 0.0)))
        packer, now = Packer(1, 1), 0
        for _ in range(250):
            now += 10_000_000
            for _ in range(4):
                far.send(mavlink(random, packer))
            far.receive()
            output = link.step(now)
            assert output is not None, case
        link.release()
        link.step(now + 10_000_000)


def test_simulated_autopilot_survives_any_frame():
    random, frame = rng("autopilot"), load_airframe("paper_quad")
    for _ in range(2 * FACTOR):
        far, near = memory_pair(lambda: 0)
        sim = Px4Sim({"api": near}, frame)
        packer, now = Packer(255, 190), 0
        for _ in range(400):
            now += STEP_NS
            for _ in range(3):
                far.send(command(random, packer) if random.random() < 0.4 else mavlink(random, packer))
            sim.step(now)
            far.receive()
        assert all(map(math.isfinite, sim.truth().position))


def command(random, packer):
    """A COMMAND_LONG with wild parameters: an infinite message interval ended the software PX4 once."""
    number = random.choice((400, 511, 512, 176, 22, 21, 20, 16, 183, 185, 241, 246, 410, 519, 520, 521))
    values = [random.choice((*FLOATS, 0.0, 1.0, 32.0, 30.0)) for _ in range(7)]
    return packer.send_name("COMMAND_LONG", 1, 1, number, 0, *(_single(value) for value in values))


def _single(value):
    return value if not math.isfinite(value) or abs(value) < 3e38 else math.inf


def can_frame(random):
    known = [can_id(name) for name in (*COMMANDS, *feedback_names())]
    number = random.choice((*known, *known, 0, 0x7FF, 0x1FFFFFFF, random.randrange(0x800)))
    return number, random.choice((random.randbytes(8), b"\xff" * 8, bytes(8), random.randbytes(random.randrange(9))))


def test_car_driver_and_simulated_car_survive_any_can_frame():
    random = rng("can")
    for _ in range(3 * FACTOR):
        far, near = memory_pair(lambda: 0)
        link, car = ScoutLink(near), ScoutSim(far)
        now = 0
        for _ in range(500):
            now += 10_000_000
            for end in (far, near):
                for _ in range(3):
                    frame = can_frame(random)
                    if frame[0] != 0x151:
                        end.send(frame)
            speed = random.choice((*FLOATS, 1.0))
            feedback = link.step(now, Command(random.choice((now, now + 10**9, 0, -(2**63))), speed, 0.0))
            car.step(now)
            assert all(map(math.isfinite, (feedback.speed, feedback.turn_rate)))
            assert math.isfinite(car.speed)
    far, near = memory_pair(lambda: 0)
    far.send((0x151, bytes(8)))
    with pytest.raises(WrongProtocolError):
        ScoutLink(near).step(0)


def test_damaged_recording_is_read_as_far_as_it_goes(tmp_path):
    random, whole = rng("mcap"), (GOLDEN_RUN / "run.mcap").read_bytes()
    limit = len(list(Recording(GOLDEN_RUN / "run.mcap").raw()))
    path = tmp_path / "run.mcap"
    for _ in range(6 * FACTOR):
        path.write_bytes(damaged(whole, random) if random.random() < 0.8 else random.randbytes(1000))
        try:
            recording = Recording(path)
            count = sum(1 for _ in recording.raw())
            list(recording.messages(["run/stage"]) if "/perch/run/stage" in recording.topics else ())
        except ReadError:
            continue
        assert count <= 2 * limit


def test_damaged_run_folder_is_recovered_or_refused(tmp_path):
    random = rng("run")
    for case in range(3 * FACTOR):
        folder = tmp_path / str(case)
        shutil.copytree(GOLDEN_RUN, folder)
        for name in ("run.mcap", "manifest.json"):
            if random.random() < 0.7:
                (folder / name).write_bytes(damaged((folder / name).read_bytes(), random))
        try:
            recover(open_run(folder).path, WHEN)
        except (RunError, ReadError, RecoverError):
            continue


def test_damaged_checklist_record_is_refused_or_not_genuine(tmp_path):
    random = rng("record")
    made = Checklist.model_validate({"title": "one", "group": [{"title": "g", "item": [{"ask": "Well?"}]}]})
    path = tmp_path / "record.json"
    record = new_record(made, {"rig": "bench", "policy": {"name": "planner"}, "scenario": "hard-i"})
    records.write(path, record)
    whole = path.read_bytes()
    for _ in range(300 * FACTOR):
        path.write_bytes(damaged(whole, random))
        try:
            found = records.read(path)
        except RecordError as error:
            assert str(error).startswith(str(path))
            continue
        json.dumps(found.as_dict(), allow_nan=False)


def test_damaged_spec_of_a_live_run_is_refused(tmp_path):
    random, path = rng("spec"), tmp_path / "spec.json"
    for _ in range(100 * FACTOR):
        path.write_bytes(damaged(b'{"scenario": "simple-i", "rig": "sim", "seed": 0}', random))
        with pytest.raises(ValueError):
            LiveSpec.read(path)


def test_damaged_key_file_is_refused(tmp_path):
    random, folder = rng("keys"), tmp_path / "keys"
    make_keys(folder, ["brain"])
    own = credentials_in(folder, "brain")
    check_keys(own)
    for path in (own.authority, own.certificate, own.key):
        whole = path.read_bytes()
        for _ in range(25 * FACTOR):
            broken = damaged(whole, random)
            path.write_bytes(broken)
            for use in (
                lambda: check_keys(own),
                lambda path=path: load_crew_key(path),
                lambda path=path: load_public_keys((str(path),)),
                lambda path=path: read_signing_key(str(path)),
            ):
                try:
                    use()
                except (KeysError, CrewKeyError, ValueError):
                    continue
        path.write_bytes(whole)


def test_any_text_as_an_address_is_read_or_refused():
    random = rng("url")
    for _ in range(500 * FACTOR):
        text = damaged(random.choice((b"udp://:14540", b"serial:///dev/ttyS0?baud=9600", b"tcp://[::1]:5")), random)
        try:
            _, _, number = check_url(text[:200].decode("latin-1"))
        except WireError:
            continue
        assert number >= 0
