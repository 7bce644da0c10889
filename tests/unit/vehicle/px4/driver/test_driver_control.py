"""Control of the vehicle: commands and their gaps, braking before it is handed back, a pilot's take-over."""

import pytest

from tests.unit.vehicle.px4.driver.driver_bench import HOVER, NAN, Bench, client, hover
from vehicle.px4 import protocol as px4
from vehicle.px4.driver.types import Rates


def test_vehicle_is_landed_after_a_gap_and_control_is_not_resumed():
    bench = Bench().to("hover")
    bench.run(0.5, hover)
    bench.run(0.32)
    assert bench.link.phase == "released"
    assert bench.reported("control lost: no command for 0.25 s")
    count = len(bench.sent)
    bench.run(3.0, hover)  # the policy is back
    assert len(bench.sent) == count
    assert bench.link.refused == 300
    assert (bench.sim.flight.active, bench.out.failsafe) == (px4.LAND, False)
    assert bench.run(20.0, hover, until=lambda: not bench.out.armed)
    bench.run(1.0)
    assert bench.sim.flight.intended == px4.HOLD


def fast(bench: Bench) -> Bench:
    """At more than 3 m/s, nose down."""
    bench.to("hover").run(0.3, hover)
    bench.run(0.3, lambda _: Rates((0.0, 2.0, 0.0), HOVER.thrust))
    assert bench.run(3.0, lambda _: Rates((0.0, 0.0, 0.0), 1.2 * HOVER.thrust), until=lambda: bench.speed > 3.0)
    return bench


@pytest.mark.parametrize("how", ["release", "gap"])
def test_fast_vehicle_brakes_at_once_before_it_is_landed(how):
    bench = fast(Bench())
    if how == "release":
        bench.link.release()
    else:
        bench.run(0.3)
    bench.run(0.3, hover)
    assert (bench.out.phase, bench.sim.flight.active) == ("brake", px4.OFFBOARD)
    assert bench.run(0.55, hover, until=lambda: bench.out.phase == "released"), "half of the time goes to the turn"
    assert bench.speed < 0.7
    assert bench.run(20.0, hover, until=lambda: not bench.out.armed)
    assert bench.out.landed


def test_pilot_keeps_control_after_taking_over_from_a_vehicle_that_brakes():
    bench = fast(Bench(gcs=True))
    bench.link.release()
    bench.run(0.1)
    bench.gcs.send(client().send_name("COMMAND_LONG", 1, 1, 176, 0, 1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0))
    bench.run(3.0)
    assert (bench.link.phase, bench.sim.flight.active) == ("interrupted", px4.HOLD)


def test_gap_shorter_than_the_limit_keeps_control():
    bench = Bench().to("hover")
    bench.run(0.5, hover)
    bench.run(0.2)
    bench.run(1.0, hover)
    assert bench.link.phase == "handed_over"
    assert bench.sim.flight.active == px4.OFFBOARD


def test_pilot_keeps_control_after_taking_over():
    bench = Bench(gcs=True).to("hover")
    bench.run(0.5, hover)
    pilot = client()
    bench.gcs.send(pilot.send_name("COMMAND_LONG", 1, 1, 176, 0, 1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0))
    bench.run(0.1, hover)
    assert bench.link.phase == "interrupted"
    assert bench.reported("the autopilot is in AUTO.LOITER")
    count = len(bench.sent)
    bench.run(3.0, hover)
    assert (len(bench.sent), bench.sim.flight.active) == (count, px4.HOLD)
    assert bench.speed < 0.3


@pytest.mark.parametrize("phase", ["goto", "hover"])
def test_pilot_can_take_over_before_offboard_control(phase):
    bench = Bench(gcs=True).to(phase)
    bench.run(1.0)
    bench.gcs.send(client().send_name("COMMAND_LONG", 1, 1, 176, 0, 1.0, 4.0, 6.0, 0.0, 0.0, 0.0, 0.0))
    bench.run(2.0, hover)
    assert (bench.link.phase, bench.sent) == ("interrupted", [])
    assert bench.sim.flight.active == px4.LAND


@pytest.mark.parametrize("phase", ["connect", "ready", "takeoff", "goto"])
def test_commands_before_the_hover_are_refused(phase):
    bench = Bench().to(phase)
    bench.run(0.1, hover)
    assert (bench.sent, bench.link.refused) == ([], 10)
    assert bench.link.phase != "handed_over"


@pytest.mark.parametrize("field", range(4))
@pytest.mark.parametrize("bad", [NAN, float("inf")])
def test_commands_that_are_not_finite_are_never_sent(field, bad):
    bench = Bench().to("hover")
    numbers = [0.0, 0.0, 0.0, 9.8]
    numbers[field] = bad
    bench.run(0.1, lambda _: Rates((numbers[0], numbers[1], numbers[2]), numbers[3]))
    assert (bench.sent, bench.link.refused, bench.link.phase) == ([], 10, "hover")


def test_sent_thrust_is_limited_to_zero_and_one():
    bench = Bench().to("hover")
    bench.run(0.02, lambda _: Rates((0.0, 0.0, 0.0), 400.0))
    bench.run(0.02, lambda _: Rates((0.0, 0.0, 0.0), -4.0))
    assert [thrust for _, _, thrust in bench.sent] == [1.0, 1.0, 0.0, 0.0]
