import math
from dataclasses import replace

import pytest

from hil.contract.messages import Action, Belief, BoardState, Contact, VehicleState
from hil.nodes.vehicle import STATUS_PERIOD_NS, VehicleLink
from hil.safety.limits import GateLimits
from hil.safety.vehicle_gate import VehicleGate
from hil.scoring.verdict import NOT_HELD
from tests.unit.hil.contract.node_fakes import filled
from vehicle.px4.driver.arming import Arming, Identity
from vehicle.px4.driver.types import ExternalPose, LinkOutput, Note, Odometry, Rates

MS = 1_000_000
NOW = 1_000 * MS


class FakeLink:
    """Returns a scripted output, records its inputs."""

    phase, armed = "handed_over", True

    def __init__(self):
        self.commands, self.calls, self.poses = [], [], []
        self.output = LinkOutput("handed_over", True, True, False, False, "OFFBOARD", 15.2, 0.49)
        self.garbage = 3
        self.parameters = {}

    def step(self, now_ns, command=None, external_pose=None):
        self.commands.append(command)
        self.poses.append(external_pose)
        self.output.sent_thrust = None if command is None else 0.5
        return self.output

    def kill(self):
        self.calls.append("kill")

    def release(self):
        self.calls.append("release")


class Rig:
    """Link node, gate and fake driver."""

    def __init__(self, **options):
        self.link = FakeLink()
        self.node = VehicleLink(self.link, VehicleGate(GateLimits()), **options)
        self.step(NOW - 4 * MS, odometry=True)

    def step(self, now_ns, *given, odometry=False, climb=0.0, ahead=0.0):
        sample = Odometry(now_ns, (0.0, 0.0, 2.0), (ahead, 0.0, climb), (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
        self.link.output.odometry = [sample] if odometry else []
        outs = self.node.step(now_ns, filled(self.node, *given))
        return {topic: [out.message for out in outs if out.topic == topic] for topic in self.node.outputs}


def test_autopilot_parameters_are_published_after_they_are_read():
    rig = Rig()
    published = []
    for phase in ("connect", "parameters", "streams", "streams", "ready", "arm"):
        rig.link.output.phase = phase
        rig.link.parameters = {"COM_OF_LOSS_T": 0.3} if phase != "connect" else {}
        published += [(phase, m.names, m.values) for m in rig.step(NOW)["vehicle/parameters"]]
    assert published == [("streams", ("COM_OF_LOSS_T",), (0.3,))]


def action(stamp=NOW, rate=(0.1, 0.2, 0.3), engaged=True):
    return "policy/action", Action(stamp, engaged, rate, 9.0, "dive", stamp, 1.0)


def contact(outcome, attached=False):
    return "referee/contact", Contact(NOW, outcome, "", attached, attached, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_vehicle_node_sends_the_command_and_publishes_it():
    rig = Rig()
    (sent,) = rig.step(NOW, action())["vehicle/sent"]
    assert rig.link.commands[-1] == Rates((0.1, 0.2, 0.3), 9.0)
    assert (sent.body_rate, sent.thrust, sent.thrust_normalised, sent.limited) == ((0.1, 0.2, 0.3), 9.0, 0.5, False)


def test_vehicle_node_sends_the_command_clipped_by_the_gate():
    rig = Rig()
    (sent,) = rig.step(NOW, action(rate=(9.0, 0.0, 0.0)))["vehicle/sent"]
    assert rig.link.commands[-1] == Rates((4.0, 0.0, 0.0), 9.0)
    assert (sent.body_rate, sent.limited) == ((4.0, 0.0, 0.0), True)


def test_vehicle_node_sends_nothing_without_a_recent_engaged_command():
    rig = Rig()
    for given in ((), (action(engaged=False),), (action(stamp=NOW - 60 * MS),)):
        assert rig.step(NOW, *given)["vehicle/sent"] == []
        assert rig.link.commands[-1] is None
    assert rig.node.counters["commands too old to send"] == 1


def test_vehicle_node_uses_only_the_newest_command():
    rig = Rig()
    rig.step(NOW, action(NOW - 10 * MS, (1.0, 0.0, 0.0)), action(NOW, (2.0, 0.0, 0.0)))
    assert rig.link.commands[-1] == Rates((2.0, 0.0, 0.0), 9.0)


def test_vehicle_node_sends_nothing_after_a_trip_and_reports_it_once():
    rig = Rig()
    outs = rig.step(NOW, action(rate=(math.nan, 0.0, 0.0)))
    assert rig.link.commands[-1] is None
    assert outs["vehicle/sent"][0].tripped == "command is not finite"
    assert [(e.severity, e.text) for e in outs["event"]] == [("error", "gate tripped: command is not finite")]
    for later in range(1, 5):
        outs = rig.step(NOW + later * 10 * MS, action(NOW + later * 10 * MS), odometry=True)
        assert rig.link.commands[-1] is None
        assert (outs["vehicle/sent"], outs["event"]) == ([], [])
    assert rig.link.calls == ["release"]


BOARD = Belief(NOW, True, (1.0, 0.0, 2.0), 0.0, 0.0, 0.0, 1.2, 1.0, NOW, 50, 0, (0.0,) * 9, 0.0, 50, 0.01)


@pytest.mark.parametrize(("board_x", "handed_back_ms"), [(1.0, 120), (3.0, None)])
def test_vehicle_is_handed_back_soon_if_commands_stop_in_the_dive(board_x, handed_back_ms):
    rig, found, events = Rig(), None, []
    belief = "belief", replace(BOARD, position=(board_x, 0.0, 2.0))
    for t in range(0, 200, 2):
        given = [action(NOW)] if t == 0 else []
        events += rig.step(NOW + t * MS, belief, *given, odometry=True, ahead=2.0)["event"]
        if rig.link.calls:
            found, rig.link.phase = t, "brake"
            break
    assert found == handed_back_ms
    events += rig.step(NOW + 300 * MS, belief, odometry=True, ahead=2.0)["event"]
    told = ["no command for 0.12 s in the dive: the vehicle is handed back"] if handed_back_ms else []
    assert ([e.text for e in events], rig.link.calls) == (told, ["release"] * len(told))


def test_vehicle_that_was_never_commanded_is_not_handed_back_for_silence():
    rig = Rig()
    for t in range(0, 300, 2):
        rig.step(NOW + t * MS, ("belief", BOARD), odometry=True, ahead=2.0)
    assert rig.link.calls == []


@pytest.mark.parametrize("phase", ["hover", "interrupted", "released", "brake"])
def test_trip_takes_no_vehicle_that_is_not_flown_by_commands(phase):
    rig = Rig()
    rig.link.phase = phase
    rig.step(NOW, action(rate=(math.nan, 0.0, 0.0)))
    assert rig.link.calls == []


def after_contact(rig, verdict, fall, until_ms=200):
    """What the driver was told, and when first (ms after the verdict), if the vehicle falls or moves with the board."""
    for t in range(0, until_ms, 2):
        speed = -9.0 * t * 1e-3 if fall else 0.1
        given = [action(NOW + t * MS, (0.1, 0.2, 0.001 * t))] if t % 10 == 0 else []
        rig.step(NOW + t * MS, verdict, *given, odometry=t % 10 == 0, climb=speed)
        if rig.link.calls:
            return set(rig.link.calls), t
    return set(), until_ms


@pytest.mark.parametrize("outcome", ["success", "fail"])
def test_motors_stop_after_contact_once_the_vehicle_stays_on_the_board(outcome):
    calls, after_ms = after_contact(Rig(), contact(outcome, attached=True), fall=False)
    assert calls == {"kill"} and 80 <= after_ms <= 100


@pytest.mark.parametrize("outcome", ["success", "fail"])
def test_vehicle_that_falls_after_contact_goes_back_to_the_autopilot(outcome):
    rig = Rig()
    calls, after_ms = after_contact(rig, contact(outcome, attached=True), fall=True)
    assert calls == {"release"} and after_ms <= 80
    rig.step(NOW + 400 * MS, contact(outcome, attached=True), odometry=True)
    assert set(rig.link.calls) == {"release"}, "the decision stands"


def test_fall_after_contact_is_reported_once():
    rig, events = Rig(), []
    for t in range(0, 200, 10):
        outs = rig.step(NOW + t * MS, contact("success", attached=True), odometry=True, climb=-9.0 * t * 1e-3)
        events += outs["event"]
    assert [(e.severity, e.text) for e in events] == [("error", NOT_HELD)]


def test_motors_idle_from_contact_until_it_is_decided_whether_the_magnet_holds():
    rig = Rig()
    rig.step(NOW, contact("success", attached=True), action())
    assert rig.link.commands[-1] == Rates((0.0, 0.0, 0.0), GateLimits().thrust[0])


def test_vehicle_without_odometry_after_contact_goes_back_to_the_autopilot():
    rig = Rig()
    for t in range(0, 200, 2):
        rig.step(NOW + t * MS, contact("success", attached=True))
    assert set(rig.link.calls) == {"release"}


@pytest.mark.parametrize("outcome", ["success", "fail"])
def test_vehicle_that_missed_goes_back_to_the_autopilot(outcome):
    rig = Rig()
    rig.step(NOW, contact("ongoing"))
    assert rig.link.calls == []
    rig.step(NOW, contact(outcome))
    assert set(rig.link.calls) == {"release"}


def test_motors_keep_running_after_contact_with_a_virtual_board():
    rig = Rig(virtual_board=True)
    rig.step(NOW, contact("success", attached=True))
    assert set(rig.link.calls) == {"release"}


def test_status_is_published_at_10_hz_and_at_every_phase_change():
    rig = Rig()
    stamps = []
    for now in range(NOW, NOW + 300 * MS, 2 * MS):
        rig.link.output.phase = "released" if now >= NOW + 150 * MS else "handed_over"
        stamps += [status.stamp_ns for status in rig.step(now)["vehicle/status"]]
    first = NOW - 4 * MS + STATUS_PERIOD_NS
    assert stamps == [first, NOW + 150 * MS, NOW + 250 * MS]


def test_vehicle_node_publishes_notes_as_events_and_odometry():
    rig = Rig()
    rig.link.output.notes = [Note("warning", "battery low")]
    outs = rig.step(NOW, odometry=True)
    assert [(e.severity, e.source, e.text) for e in outs["event"]] == [("warning", "vehicle_link", "battery low")]
    assert outs["vehicle/odometry"] == [
        VehicleState(NOW, (0.0, 0.0, 2.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
    ]
    assert rig.node.counters["bytes of garbage on the vehicle's wire"] == 3


SEEN = "mocap/vehicle", VehicleState(NOW - 5 * MS, (1.0, 2.0, 3.0), (9.0,) * 3, (0.6, 0.8, 0.0, 0.0), (9.0,) * 3)


def test_motion_capture_is_sent_to_the_autopilot_when_the_rig_enables_it():
    rig = Rig(external_pose=True)
    rig.step(NOW, SEEN)
    assert rig.link.poses[-1] == ExternalPose(NOW - 5 * MS, (1.0, 2.0, 3.0), (0.6, 0.8, 0.0, 0.0))
    rig = Rig()
    rig.step(NOW, SEEN)
    assert rig.link.poses[-1] is None


@pytest.mark.parametrize(
    ("phase", "armed", "calls"),
    [
        ("released", True, ["kill"]),
        ("failed", True, ["kill"]),
        ("released", False, []),
        ("interrupted", True, []),  # a pilot may fly it
        ("hover", True, []),
    ],
)
def test_motors_of_a_vehicle_that_was_handed_back_and_is_on_the_floor_are_stopped(phase, armed, calls):
    rig, texts = Rig(), []
    rig.link.phase, rig.link.armed = phase, armed
    for t in range(0, 9_000, 10):
        seen = replace(SEEN[1], stamp_ns=NOW + t * MS, position=(1.0, 2.0, 0.1 + 1e-5 * (t % 30)))
        texts += [e.text for e in rig.step(NOW + t * MS, ("mocap/vehicle", seen))["event"]]
        if rig.link.calls:
            break
    told = ["on the floor for 8 s, and not disarmed by the autopilot: the motors are stopped"]
    assert (rig.link.calls, texts) == (calls, told * len(calls))


def test_vehicle_node_passes_the_conditions_for_arming_to_the_driver():
    rig = Rig()
    rig.link.allow_arming = rig.link.calls.append
    arming = Arming(Identity("4954", ""), {"COM_OF_LOSS_T": 0.3})
    rig.node.permit(arming.table())
    assert rig.link.calls == [arming]
    with pytest.raises(ValueError, match="no conditions for arming"):
        rig.node.permit(None)


@pytest.mark.parametrize("changes", [{"stamp_ns": NOW + 6 * MS}, {"position": (math.nan, 0.0, 0.0)}])
def test_broken_motion_capture_is_not_sent_to_the_autopilot_and_reported_once(changes):
    rig = Rig(external_pose=True)
    broken = SEEN[0], replace(SEEN[1], **changes)
    (event,) = rig.step(NOW, broken)["event"]
    assert "not passed on to the autopilot" in event.text
    assert rig.step(NOW, broken)["event"] == []
    assert rig.link.poses[-1] is None
    assert rig.node.counters["poses of motion capture not passed on to the autopilot"] == 2
    rig.step(NOW, SEEN)
    assert rig.link.poses[-1] is not None


def before_arming(orientation, seconds, position=(1.0, 2.0, 0.1)):
    """What the node asks of its driver, and its events, while the driver waits for arming to be allowed."""
    rig = Rig(mocap_reach=25.0)
    rig.link.output.phase = "ready"
    rig.link.allow_arming = lambda arming: rig.link.calls.append("allow")
    rig.node.permit(Arming().table())

    def refuse():
        rig.link.calls.append("refuse")
        rig.link.output.phase = "failed"

    rig.link.refuse_arming = refuse
    events = []
    for now in range(NOW, NOW + round(seconds * 1000) * MS, 10 * MS):
        seen = VehicleState(now - 5 * MS, position, (0.0,) * 3, orientation, (0.0,) * 3)
        events += rig.step(now, ("mocap/vehicle", seen), odometry=True)["event"]
    return set(rig.link.calls), [event.text for event in events]


def test_arming_is_allowed_once_motion_capture_agrees_with_the_autopilot():
    level = (1.0, 0.0, 0.0, 0.0)
    assert before_arming(level, 0.25) == (set(), [])
    assert before_arming(level, 0.5) == ({"allow"}, [])


@pytest.mark.parametrize(
    ("orientation", "position", "why"),
    [
        ((math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0), (1.0, 2.0, 0.1), "tilted by 90 deg"),
        ((0.0, 0.0, 0.0, 1.0), (1.0, 2.0, 0.1), "heading is 180 deg off"),
        ((1.0, 0.0, 0.0, 0.0), (1000.0, 2000.0, 100.0), "millimetres"),
    ],
)
def test_vehicle_is_not_armed_on_motion_capture_that_contradicts_the_autopilot(orientation, position, why):
    assert before_arming(orientation, 19.0, position) == (set(), [])
    calls, (text,) = before_arming(orientation, 21.0, position)
    assert calls == {"refuse"}
    assert text.startswith("not armed: ") and why in text


def test_vehicle_that_flies_to_where_the_board_is_not_by_motion_capture_is_handed_back():
    rig = Rig()
    rig.link.phase = "handed_over"
    level, zero = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    vehicle = VehicleState(NOW - 5 * MS, (0.0, 0.0, 2.0), (3.5, 0.0, 0.0), level, zero)
    board = BoardState(NOW - 5 * MS, (0.7, 0.0, 2.0), zero, level, 0.0, 0.0, 0.0)
    belief = Belief(NOW, True, (1.0, 0.0, 2.0), 0.0, 0.0, 0.0, 1.2, 1.0, NOW, 9, 0, (0.0,) * 9, 0.0, 9, 0.01)
    right = replace(belief, position=(0.7, 0.0, 2.0))
    seen = ("mocap/vehicle", vehicle), ("mocap/board", board)
    assert rig.step(NOW, action(), *seen, ("belief", right), odometry=True)["vehicle/sent"][0].thrust == 9.0
    outs = rig.step(NOW, action(), *seen, ("belief", belief), odometry=True)
    assert [event.text for event in outs["event"]] == [
        "gate tripped: the board is 0.30 m off where it is believed to be, 0.7 m ahead at 3.5 m/s"
    ]
    assert rig.link.calls == ["release"]
