"""The driver when things go wrong: refusals, garbage, other clients, lost links, wrong vehicles."""

import random

import pytest

from tests.unit.vehicle.px4.driver.driver_bench import NAN, START, Bench, client, hover
from vehicle.px4 import protocol as px4
from vehicle.px4.driver.arming import Arming
from vehicle.px4.driver.types import LinkConfig

# refusals


def test_refused_arming_fails_with_the_autopilots_text():
    bench = Bench().to("arm")
    bench.sim.flight.terminated = True
    bench.to("failed")
    (text,) = bench.reported("arming was refused")
    assert "TEMPORARILY_REJECTED) after 8 tries" in text
    assert "; the autopilot reports: " in text and "Arming denied: Resolve system health failures first" in text
    assert bench.seconds < 12.0
    assert not bench.sim.flight.armed


def test_driver_does_not_arm_before_arming_is_allowed():
    bench = Bench(arm=False, prearm_limit=3.0).to("ready")
    bench.run(12.0, hover)
    assert bench.link.phase == "ready"
    assert not bench.sim.flight.armed
    bench.link.allow_arming(Arming())
    bench.to("hover")


def test_arming_without_an_answer_fails():
    bench = Bench().to("arm")
    bench.stop_reception(True)
    bench.to("failed")
    assert bench.reported("arming was refused (no answer) after 8 tries")


def test_prearm_checks_that_never_pass_fail():
    bench = Bench(sim={"parameters": {"SENS_EN_GPSSIM": 0, "SYS_HAS_GPS": 0}}, prearm_limit=8.0)
    bench.to("failed")
    assert bench.reported("not ready after 8 s: its pre-arm checks did not pass")


def test_parameter_that_px4_lacks_is_reported_and_the_rest_is_set():
    bench = Bench(parameters={"COM_OF_LOS_T": 0.3, "COM_OBL_RC_ACT": 4}, tries=2).to("ready")
    assert bench.reported("this PX4 has no parameter COM_OF_LOS_T, or does not answer: not set")
    assert bench.sim.flight.parameters["COM_OBL_RC_ACT"] == 4
    assert bench.reported("COM_OF_LOSS_T is 1 s"), "what was meant is judged all the same"
    assert [note.severity for _, note in bench.notes if "COM_OF_LO" in note.text] == ["warning"] * 2


def test_px4_without_parameter_answers_is_not_flown():
    bench = Bench(tries=2).to("parameters")
    bench.stop_reception(True)
    bench.to("failed")
    assert bench.reported("the autopilot answers no request for a parameter")


def test_px4_without_the_offboard_loss_parameters_is_not_armed():
    assert LinkConfig(start=START).required == ("COM_OF_LOSS_T", "COM_OBL_RC_ACT")
    bench = Bench(tries=2, required=("COM_OF_LOSS_T", "COM_NO_SUCH"), parameters={"COM_NO_SUCH": 1.0}).to("failed")
    assert bench.reported("this PX4 has no parameter COM_NO_SUCH, or does not answer")
    assert bench.reported("it is not armed")
    assert not bench.sim.truth().armed


def test_parameter_that_px4_rejects_fails_in_bounded_time():
    bench = Bench(tries=3)
    bench.sim.flight.parameters.set_wire = lambda *_: None
    bench.to("failed")
    assert bench.reported("COM_OF_LOSS_T, COM_OBL_RC_ACT was not accepted")
    assert bench.seconds < 6.0


def test_integer_parameters_are_sent_as_integers():
    bench = Bench(parameters={"COM_OBL_RC_ACT": 5.0, "COM_OF_LOSS_T": 0.4, "NAV_RCL_ACT": 3}).to("ready")
    values = bench.sim.flight.parameters
    assert (values["COM_OBL_RC_ACT"], values["NAV_RCL_ACT"]) == (5, 3)
    assert values["COM_OF_LOSS_T"] == pytest.approx(0.4)
    assert isinstance(values["NAV_RCL_ACT"], int)


def test_already_armed_vehicle_gets_no_commands():
    bench = Bench().to("goto")
    bench.relink()
    bench.uplink.clear()
    bench.to("failed")
    assert bench.reported("already armed")
    bench.run(5.0)
    assert bench.asked == {"HEARTBEAT", "TIMESYNC"}, "not even a landing is asked for"
    assert bench.sim.flight.failsafe, "PX4 lands by itself, as the set-points have stopped"


def test_vehicle_with_another_hover_thrust_than_its_file_is_landed():
    bench = Bench(hover_thrust=0.25).to("failed")
    assert bench.reported("hover thrust is 0.44") and bench.reported("wrong airframe file")
    assert bench.run(20.0, until=lambda: not bench.sim.flight.armed)
    assert bench.sim.truth().position[2] == pytest.approx(0.0, abs=0.05)


def test_dead_motor_fails_before_offboard_control():
    bench = Bench(goto_limit=8.0)
    bench.to("goto")
    bench.sim.fail_motor(0, 0.2)
    bench.run(15.0, hover)
    assert bench.link.phase in ("failed", "interrupted")
    assert not bench.sent


# the wire


def test_invalid_bytes_are_counted_and_ignored_by_the_driver():
    rng = random.Random(5)
    bench = Bench()

    def send_noise():
        if rng.random() < 0.2:
            noise = bytes(rng.choices(range(256), k=rng.randint(1, 60)))
            bench.tap.noise.append(noise)
            bench.theirs.peer.send(bytes(rng.choices(range(256), k=20)))

    bench.each = send_noise
    bench.to("hover", limit=60.0)
    bench.run(0.3, hover)
    assert bench.link.phase == "handed_over"
    assert bench.link.garbage > 10_000


def test_heartbeats_of_other_clients_are_ignored():
    """PX4 forwards them: an armed drone in MANUAL from 255/190, and PX4's system with another component."""
    bench = Bench(gcs=True)
    others = [client(), client(1, 191), client(2, 1)]

    def send_heartbeats():
        for other in others:
            bench.gcs.send(other.send_name("HEARTBEAT", 2, 12, 0x91, 0x00010000, 5, 3))
            bench.tap.noise.append(other.send_name("HEARTBEAT", 2, 12, 0x91, 0x00010000, 5, 3))

    bench.each = lambda: send_heartbeats() if bench.now % 200_000_000 == 0 else None
    bench.to("hover")
    assert bench.link.counters["foreign_frames"] > 100
    assert not bench.out.failsafe
    assert not bench.reported("MANUAL")


def test_other_systems_without_px4_are_reported():
    bench = Bench(system=3)
    bench.run(11.0)
    assert bench.link.phase == "connect"
    assert bench.reported("no PX4 received as system 3, component 1 yet (received: 1/1")


def test_lost_link_is_reported():
    bench = Bench().to("hover")
    bench.theirs.peer._inbound.clear()
    stopped = bench.sim.step
    bench.sim.step = lambda now: None
    bench.run(4.0)
    assert not bench.out.connected
    assert bench.reported("link lost: no HEARTBEAT for 3 s")
    bench.sim.step = stopped


def test_reboot_restarts_on_the_ground_and_fails_in_flight():
    for phase, then in (("ready", "hover"), ("goto", "failed")):
        bench = Bench().to(phase)
        bench.run(2.5)
        fresh = Bench(begin_ns=bench.now)
        fresh.sim.ports["api"]._wire = bench.theirs
        bench.sim = fresh.sim
        bench.sim.step(bench.now)
        bench.to(then)
        assert bench.reported("the autopilot has rebooted")
        if then == "hover":
            assert bench.link.counters["clock_offset_ns"] == pytest.approx(-fresh.begin, abs=2_000_000)


@pytest.mark.parametrize(
    ("x", "attitude", "ahead_us"),
    [(NAN, (1.0, 0.0, 0.0, 0.0), 3000), (0.0, (0.0, 0.0, 0.0, 0.0), 3000), (0.0, (1.0, 0.0, 0.0, 0.0), -50_000)],
    ids=["not a number", "no rotation", "older than the last"],
)
def test_invalid_odometry_is_counted(x, attitude, ahead_us):
    bench = Bench().to("hover")
    values = (
        bench.sim.boot_ns // 1000 + ahead_us,
        1,
        1,
        x,
        0.0,
        0.0,
        attitude,
        *(0.0,) * 6,
        *((NAN,) * 21,) * 2,
        4,
        8,
        0,
    )
    bench.tap.noise.append(client(1, 1).send_name("ODOMETRY", *values))
    samples = len(bench.odometry)
    bench.step()
    assert bench.link.counters["bad_odometry"] == 1
    assert len(bench.odometry) - samples <= 1
    bench.run(0.1)
    assert len(bench.odometry) - samples >= 9


# the driver dies


@pytest.mark.parametrize("after_s", [0.0, 0.05, 0.3, 0.9, 1.2, 2.0, 3.0, 4.0, 6.0, 9.0])
def test_a_driver_that_dies_after_arming_leaves_a_vehicle_that_lands_and_disarms(after_s):
    """`kill -9` at any moment from arming on: the autopilot's own failsafe lands it, nothing else has to act."""
    bench = Bench().to("takeoff")
    bench.run(after_s)
    bench.step = lambda command=None: None
    assert bench.run(40.0, until=lambda: not bench.sim.flight.armed), bench.sim.truth()
    assert bench.sim.truth().position[2] == pytest.approx(0.0, abs=0.05)


def test_a_take_off_in_auto_would_end_in_a_hover_without_end():
    """As a real PX4 does: no set-points are missed there, so that no failsafe acts."""
    bench = Bench(arm=False).to("ready")
    bench.run(6.0)
    bench.step = lambda command=None: None
    for number, *params in ((176, 1.0, 4.0, 3.0), (400, 1.0), (22, *(NAN,) * 7)):
        values = (*params, *(0.0,) * (7 - len(params)))
        bench.theirs.peer.send(client().send_name("COMMAND_LONG", 1, 1, number, 0, *values))
        bench.run(0.1)
    bench.run(60.0)
    assert bench.sim.flight.armed and bench.sim.flight.active == px4.HOLD
    assert bench.sim.truth().position[2] == pytest.approx(2.5, abs=0.5)
