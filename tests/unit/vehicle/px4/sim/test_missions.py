"""Missions: what is taken and given back, what is flown; lists of geofence and rally points."""

import math

import pytest

from tests.unit.vehicle.px4.sim.client import NAN, Rig
from vehicle.px4 import protocol as px4
from vehicle.px4.protocol import MissionResult, MissionState
from vehicle.px4.sim.services.plan import FENCE, MISSION, RALLY

WAYPOINT, LAND, TAKEOFF, RTL, DELAY, JUMP, SPEED = 16, 21, 22, 20, 93, 177, 178


@pytest.fixture
def ready():
    return Rig()


def item(rig, command, x=0.0, y=0.0, z=0.0, params=(0.0, 0.0, 0.0, NAN), frame=6, auto=1):
    """(frame, command, autocontinue, four params, x, y, z) of MISSION_ITEM_INT at a world position."""
    place = rig.flight.geodetic(x, y) if frame != 2 and (x or y) else (0, 0)
    return frame, command, auto, params, *place, z


def upload(rig, items, kind=MISSION, ms=400):
    """Answer PX4's requests with the items; the types of its acknowledgements."""
    rig.log.clear()
    rig.send("MISSION_COUNT", 1, 1, len(items), kind)
    given, end = set(), rig.ms + ms
    while rig.ms < end and not rig.of("MISSION_ACK"):
        rig.run(4)
        for request in rig.of("MISSION_REQUEST_INT"):
            if request.seq not in given:
                given.add(request.seq)
                frame, command, auto, params, x, y, z = items[request.seq]
                current = int(request.seq == 0)
                rig.send("MISSION_ITEM_INT", 1, 1, request.seq, frame, command, current, auto, *params, x, y, z, kind)
    return [(m.type, m.mission_type) for m in rig.of("MISSION_ACK")]


def download(rig, kind=MISSION):
    rig.log.clear()
    rig.send("MISSION_REQUEST_LIST", 1, 1, kind)
    rig.run(12)
    count = rig.of("MISSION_COUNT")[-1].count
    for seq in range(count):
        rig.send("MISSION_REQUEST_INT", 1, 1, seq, kind)
        rig.run(8)
    rig.send("MISSION_ACK", 1, 1, 0, kind)
    rig.run(8)
    return rig.of("MISSION_ITEM_INT")


def until(rig, condition, seconds):
    """Whether it comes true within that many seconds of PX4's time."""
    end = rig.ms + 1000 * seconds
    while rig.ms < end:
        if condition():
            return True
        rig.run(40)
    return False


def test_mission_is_given_back_as_it_was_taken(ready):
    items = [
        item(ready, WAYPOINT, 3.0, 4.0, 5.0, (1.0, 0.5, 0.0, 90.0)), item(ready, SPEED, params=(1, 2, -1, 0), frame=2),
        item(ready, RTL, frame=2),
    ]  # fmt: skip
    assert upload(ready, items) == [(MissionResult.ACCEPTED, MISSION)]
    got = download(ready)
    assert [(m.seq, m.frame, m.command, m.current) for m in got] == [(0, 6, 16, 1), (1, 2, 178, 0), (2, 2, 20, 0)]
    assert (got[0].x, got[0].y) == items[0][4:6] and (got[0].z, got[0].param2, got[0].param4) == (5.0, 0.5, 90.0)
    ready.run(1200)
    now = ready.of("MISSION_CURRENT")[-1]
    assert (now.seq, now.total, now.mission_state) == (0, 3, MissionState.NOT_STARTED)
    assert download(ready, FENCE) == []


@pytest.mark.parametrize(
    ("kind", "command", "frame", "params", "why"),
    [
        (MISSION, 31999, 6, (0, 0, 0, 0), MissionResult.UNSUPPORTED),
        (MISSION, WAYPOINT, 1, (0, 0, 0, 0), MissionResult.UNSUPPORTED_FRAME),
        (MISSION, 5001, 6, (4, 0, 0, 0), MissionResult.ERROR),
        (FENCE, 5001, 6, (2, 0, 0, 0), MissionResult.ERROR),
        (FENCE, 5001, 6, (NAN, 0, 0, 0), MissionResult.ERROR),
        (MISSION, DELAY, 6, (0, 0, 0, 0), MissionResult.UNSUPPORTED),
    ],
)
def test_item_that_px4_does_not_take_ends_the_upload(ready, kind, command, frame, params, why):
    assert upload(ready, [item(ready, command, 1.0, 1.0, 3.0, params, frame)], kind) == [(why, kind)]
    assert ready.flight.plan.items[kind] == ()
    assert "IGN MISSION_ITEM: Invalid item\t" in ready.texts()


def test_lists_are_bounded_cleared_and_of_known_kinds(ready):
    for kind, count, why in ((FENCE, 65, 4), (MISSION, 2001, 4), (7, 1, 5), (RALLY, 0, 0)):
        ready.log.clear()
        ready.send("MISSION_COUNT", 1, 1, count, kind)
        ready.run(12)
        assert [m.type for m in ready.of("MISSION_ACK")] == [why]
    square = [item(ready, 5001, x, y, 0.0, (4, 0, 0, 0)) for x, y in ((9, 9), (9, -9), (-9, -9), (-9, 9))]
    assert upload(ready, square, FENCE) == [(0, FENCE)]
    assert upload(ready, [item(ready, 5100, 5.0, 5.0, 3.0)], RALLY) == [(0, RALLY)]
    assert [m.command for m in download(ready, FENCE)] == [5001] * 4
    ready.send("MISSION_CLEAR_ALL", 1, 1, 255)
    ready.run(12)
    assert ready.flight.plan.items == {MISSION: (), FENCE: (), RALLY: ()}


def test_lost_item_is_asked_for_again_and_a_silent_partner_is_given_up(ready):
    ready.send("MISSION_COUNT", 1, 1, 2, MISSION)
    ready.run(900)
    assert {m.seq for m in ready.of("MISSION_REQUEST_INT")} == {0} and len(ready.of("MISSION_REQUEST_INT")) >= 3
    ready.send("MISSION_CLEAR_ALL", 1, 1, MISSION)
    ready.run(5000)
    assert {"Operation timeout\t", "WPM: IGN CLEAR CMD: Busy\t"} <= set(ready.texts())
    assert upload(ready, [item(ready, WAYPOINT, 1.0, 1.0, 3.0)]) == [(0, MISSION)]


def test_float_items_are_taken_and_given(ready):
    ready.send("MISSION_COUNT", 1, 1, 1, MISSION)
    ready.run(8)
    lat, lon = (v / 1e7 for v in ready.flight.geodetic(10.0, 20.0))
    ready.send("MISSION_ITEM", 1, 1, 0, 3, WAYPOINT, 1, 1, 0.0, 0.0, 0.0, NAN, lat, lon, 4.0, MISSION)
    ready.run(8)
    assert [m.type for m in ready.of("MISSION_ACK")] == [0]
    stored = ready.flight.plan.mission[0]
    assert stored.frame == 6 and ready.flight.place(stored.x / 1e7, stored.y / 1e7) == pytest.approx((10, 20), abs=0.5)
    ready.send("MISSION_REQUEST_LIST", 1, 1, MISSION)
    ready.run(8)
    ready.send("MISSION_REQUEST", 1, 1, 0, MISSION)
    ready.run(8)
    assert ready.of("MISSION_ITEM")[-1].x == pytest.approx(lat, abs=1e-5)


def test_mission_takes_off_flies_its_items_and_holds_at_its_end():
    rig = Rig()
    items = [
        item(rig, SPEED, params=(1, 8.0, -1, 0), frame=2), item(rig, WAYPOINT, 6.0, 0.0, 4.0, (0.5, 0.3, 0, NAN)),
        item(rig, 2000, frame=2), item(rig, WAYPOINT, 6.0, 8.0, 5.0, (0, 0.3, 0, NAN)),
        item(rig, DELAY, params=(1, 0, 0, 0), frame=2),
    ]  # fmt: skip
    assert upload(rig, items) == [(0, MISSION)]
    assert rig.ask(300, 0.0, 0.0) == [0] and rig.flight.armed
    assert until(rig, lambda: rig.flight.plan.reached >= 1, 40), rig.flight.plan
    assert rig.sim.truth().position == pytest.approx((6.0, 0.0, 4.0), abs=0.9)
    assert until(rig, lambda: rig.flight.active == px4.HOLD, 30), rig.flight.plan
    assert rig.sim.truth().position == pytest.approx((6.0, 8.0, 5.0), abs=0.9)
    rig.run(1200)
    assert sorted({m.seq for m in rig.of("MISSION_ITEM_REACHED")}) == [0, 1, 2, 3, 4]
    assert {"Armed by mission start\t", "Takeoff to 4.0 meters above home\t", "Mission finished, loitering\t"} <= {
        *rig.texts()
    }
    assert rig.of("MISSION_CURRENT")[-1].mission_state == MissionState.COMPLETE


def test_paused_mission_holds_and_goes_on_where_it_was():
    rig = Rig()
    assert upload(rig, [item(rig, WAYPOINT, x, 0.0, 3.0, (0, 0.5, 0, NAN)) for x in (2.0, 12.0)]) == [(0, MISSION)]
    assert rig.ask(300, 0.0, 0.0) == [0]
    assert until(rig, lambda: rig.flight.plan.current == 1, 40)
    rig.run(800)
    assert rig.mode(4, 3)[-1] == 0
    rig.run(4000)
    here = rig.sim.truth()
    assert math.hypot(*here.velocity) < 0.3 and here.position[0] < 11.0
    assert rig.of("MISSION_CURRENT")[-1].mission_state == MissionState.PAUSED
    assert rig.mode(4, 4)[-1] == 0
    assert until(rig, lambda: rig.flight.plan.reached == 1, 20)
    assert rig.sim.truth().position[0] == pytest.approx(12.0, abs=0.9)


def test_mission_with_take_off_and_landing_ends_disarmed_on_the_ground():
    rig = Rig()
    items = [item(rig, TAKEOFF, z=3.0), item(rig, LAND, 4.0, 0.0, 0.0)]
    assert upload(rig, items) == [(0, MISSION)]
    assert rig.mode(4, 4)[-1] == 0 and rig.ask(400, 1.0) == [0]
    assert until(rig, lambda: not rig.flight.armed, 60), rig.flight.plan
    assert rig.sim.truth().position == pytest.approx((4.0, 0.0, 0.0), abs=1.0)
    assert "Mission finished, landed\t" in rig.texts() and "Disarmed by landing\t" in rig.texts()


def test_mission_that_returns_hands_over_to_return_and_a_jump_repeats_its_items():
    rig = Rig()
    items = [
        item(rig, WAYPOINT, 1.0, 0.0, 3.0), item(rig, JUMP, params=(0, 2, 0, 0), frame=2), item(rig, RTL, frame=2)
    ]  # fmt: skip
    assert upload(rig, items) == [(0, MISSION)]
    assert rig.ask(300, 0.0, 0.0) == [0]
    assert until(rig, lambda: rig.flight.active == px4.RTL, 40), rig.flight.plan
    assert until(rig, lambda: not rig.flight.armed, 60)


def test_without_a_mission_there_is_none_to_start_and_current_item_must_be_in_the_list(ready):
    assert ready.ask(300, 0.0, 0.0) == [2] and "Mission start denied! No valid mission\t" in ready.texts()
    assert ready.mode(4, 4)[-1] == 0 and ready.ask(400, 1.0) == [1]
    upload(ready, [item(ready, WAYPOINT, x, 0.0, 3.0) for x in (2.0, 4.0)])
    ready.send("MISSION_SET_CURRENT", 1, 1, 2)
    ready.send("MISSION_SET_CURRENT", 1, 1, 1)
    ready.run(1100)
    assert "WPM: WP CURR CMD: Not in list\t" in ready.texts() and ready.of("MISSION_CURRENT")[-1].seq == 1
    assert ready.ask(300, 2.0, 0.0) == [2]


def test_mission_mode_is_told_in_take_off_and_landing_too_as_recorded():
    rig = Rig().fly_to_hover()
    rig.run(1100)
    hold = rig.of("MISSION_CURRENT")[-1]
    assert rig.ask(21) == [0]
    rig.run(1100)
    land = rig.of("MISSION_CURRENT")[-1]
    assert [(m.seq, m.total, m.mission_state, m.mission_mode) for m in (hold, land)] == [
        (0, 65535, 1, 2), (0, 65535, 1, 1),
    ]  # fmt: skip
