"""The software PX4 alone on UDP, and pytest's fixture that starts it."""

import math
import socket
import tomllib
from importlib import import_module

import pytest
from pymavlink import mavutil
from typer.testing import CliRunner

from hil.cli.main import app
from hil.host.pytest_px4 import px4_sim  # noqa: F401  (the fixture under test)
from hil.host.standalone import BOOTED_S, FREE, GROUND, OFFBOARD, LinkAddress, StandalonePx4, link_address
from hil.wires import WireError
from tests.paths import ROOT
from vehicle.px4.codec import Packer, Parser

ARM, TAKEOFF, ACK = 400, 22, "COMMAND_ACK"


class Client:
    """A user's own code on a socket: sends by name, keeps what came."""

    def __init__(self, port):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.address, self.packer, self.parser, self.frames = ("127.0.0.1", port), Packer(245, 190), Parser(), []

    def send(self, name, *values):
        self.socket.sendto(self.packer.send_name(name, *values), self.address)

    def command(self, number, *params):
        self.send("COMMAND_LONG", 1, 1, number, 0, *params, *(0.0,) * (7 - len(params)))

    def beat(self):
        self.send("HEARTBEAT", 6, 8, 0, 0, 4, 3)
        self.read()

    def read(self):
        while True:
            try:
                self.frames += self.parser.feed(self.socket.recv(65536))
            except BlockingIOError:
                return

    def of(self, name):
        return [frame.fields for frame in self.frames if frame.name == name]


def take_off(px4, client, seconds=9.0):
    client.beat()
    client.command(ARM, 1.0)
    px4.run(0.2, client.read)
    client.command(TAKEOFF, math.nan, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
    px4.run(seconds, client.read)
    return px4.truth()


def test_fixture_in_lockstep_flies_in_virtual_time_and_twice_the_same(px4_sim):  # noqa: F811
    truths = []
    for _ in range(2):
        px4 = px4_sim(lockstep=True, seed=7)
        assert px4.seconds == pytest.approx(BOOTED_S)
        client = Client(px4.port)
        truths.append(take_off(px4, client))
        assert [(m.command, m.result) for m in client.of(ACK)] == [(ARM, 0), (TAKEOFF, 0)]
        client.socket.close()
    assert truths[0] == truths[1]
    assert truths[0].armed and truths[0].position[2] > 1.5


def test_time_stands_still_between_runs_in_lockstep(px4_sim):  # noqa: F811
    px4 = px4_sim(lockstep=True)
    before = px4.seconds
    client = Client(px4.port)
    client.command(ARM, 1.0)
    assert px4.seconds == before and not px4.truth().armed
    px4.run(0.1)
    assert px4.truth().armed
    client.socket.close()


def test_pymavlink_connects_to_the_fixtures_port(px4_sim):  # noqa: F811
    px4 = px4_sim(lockstep=True)
    link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{px4.port}", source_system=255)
    link.mav.heartbeat_send(6, 8, 0, 0, 4)
    px4.run(1.2)
    beat = link.recv_match(type="HEARTBEAT", blocking=True, timeout=30)
    link.close()
    assert beat is not None and beat.autopilot == 12


def test_faults_are_set_while_time_stands_still(px4_sim):  # noqa: F811
    px4 = px4_sim(lockstep=True)
    client = Client(px4.port)
    assert take_off(px4, client).position[2] > 1.5
    with px4.held() as autopilot:
        autopilot.fail_motor(0)
    px4.run(4.0, client.read)
    assert px4.truth().position[2] < 0.5
    client.socket.close()


def test_parameters_are_set_before_it_boots(px4_sim):  # noqa: F811
    px4 = px4_sim(lockstep=True, parameters={"MIS_TAKEOFF_ALT": 4.0})
    client = Client(px4.port)
    assert take_off(px4, client, 12.0).position[2] > 3.0
    client.socket.close()


def test_two_of_a_test_have_ports_of_their_own(px4_sim):  # noqa: F811
    first, second = px4_sim(lockstep=True), px4_sim("paper_quad", lockstep=True)
    assert first.port != second.port and first.url == f"udpout://127.0.0.1:{first.port}"


def test_ground_station_is_answered_on_a_link_of_its_own():
    px4 = StandalonePx4(ground=FREE)
    assert px4.ground is not None
    client, station = Client(px4.port), Client(px4.ground.address[1])
    client.beat()
    station.beat()
    px4.run(2.0, lambda: (client.read(), station.read()), 0.1)
    rates = [len([m for m in one.frames if m.name == "ODOMETRY"]) for one in (client, station)]
    assert rates[0] > 20 and rates[1] == 0  # PX4's Normal profile has no ODOMETRY
    assert station.of("HEARTBEAT")
    for one in (client, station):
        one.socket.close()
    px4.close()
    px4.close()


@pytest.mark.parametrize(
    ("url", "usual", "address"),
    [
        ("udp://:14540", OFFBOARD, LinkAddress(("127.0.0.1", 14580), ("127.0.0.1", 14540))),
        ("udpin://0.0.0.0:14541", OFFBOARD, LinkAddress(("127.0.0.1", 14581), ("127.0.0.1", 14541))),
        ("udp://:14550", GROUND, LinkAddress(("127.0.0.1", 18570), ("127.0.0.1", 14550))),
        ("udp://10.0.0.7:14550", GROUND, LinkAddress(("0.0.0.0", 18570), ("10.0.0.7", 14550))),
        ("udp://:0", OFFBOARD, FREE),
    ],
)
def test_address_is_where_the_client_listens(url, usual, address):
    assert link_address(url, usual) == address


@pytest.mark.parametrize("url", ["tcp://10.0.0.7:14540", "serial:///dev/ttyACM0", "udp://:65530", "14540", ""])
def test_other_addresses_are_refused(url):
    with pytest.raises(WireError):
        link_address(url, OFFBOARD)


def test_failure_in_the_thread_is_raised_by_close():
    px4 = StandalonePx4()
    with px4.held() as autopilot:
        autopilot.step = lambda _: (_ for _ in ()).throw(RuntimeError("broken"))
    px4.start()
    px4._thread.join(60.0)
    assert isinstance(px4.failure, RuntimeError)
    with pytest.raises(RuntimeError, match="broken"):
        px4.close()


def test_a_negative_time_and_a_speed_that_stands_still_are_refused():
    px4 = StandalonePx4()
    for call in (lambda: px4.run(-1.0), lambda: px4.run(math.inf), lambda: px4.start(0.0)):
        with pytest.raises(ValueError, match=r"finite|forwards"):
            call()
    px4.close()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--speed", "0"], 2, "--speed 0"),
        (["--speed", "fast"], 2, "or max"),
        (["--param", "MIS_TAKEOFF_ALT"], 2, "NAME=VALUE"),
        (["--param", "MIS_TAKEOF_ALT=5"], 2, "MIS_TAKEOF_ALT"),
        (["--param", "MIS_TAKEOFF_ALT=nan"], 2, "with a number"),
        (["--airframe", "sih_quat"], 2, "sih_quad"),
        (["--listen", "tcp://:14540"], 2, "tcp://:14540"),
        (["--gcs", "14550"], 2, "14550"),
    ],
)
def test_command_refuses_bad_input_in_one_line(arguments, code, words):
    result = CliRunner().invoke(app, ["px4", "--listen", "udp://:0", "--gcs", "none", *arguments])
    assert result.exit_code == code and words in result.output
    assert len(result.output.splitlines()) == 1


def test_command_names_a_port_that_is_in_use():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1] - OFFBOARD[1] + OFFBOARD[0]
        result = CliRunner().invoke(app, ["px4", "--listen", f"udp://:{port}", "--gcs", "none"])
    assert result.exit_code == 3 and "is in use" in result.output


def test_pytest_finds_the_plugin_by_its_entry_point():
    table = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]["pytest11"]
    for name, module in table.items():
        assert name == module, "registered by the same name that `pytest_plugins` gives it"
        assert hasattr(import_module(module), "px4_sim")
