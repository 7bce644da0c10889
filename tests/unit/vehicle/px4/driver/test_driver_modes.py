"""PX4's mode in the driver: after the first ACK of a mode change, and when HEARTBEATs stop."""

from tests.unit.vehicle.px4.driver.driver_bench import MS, Bench
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import Packer, Parser
from vehicle.px4.driver.types import Rates

HOVER = Rates((0.0, 0.0, 0.0), 9.80665)


def hover(_):
    return HOVER


def test_first_ack_of_a_mode_change_does_not_set_the_mode():
    """PX4 sends ACCEPTED before it checks the mode; the refusal comes in a second ACK."""
    bench, acks = Bench(), Parser()
    asked = bench.sim.commander.request_mode

    def refuse(custom):
        if custom == px4.OFFBOARD:
            return px4.Result.TEMPORARILY_REJECTED, "Switching to Offboard is currently not available\t"
        return asked(custom)

    bench.sim.commander.request_mode = refuse
    received, seen = bench.tap.receive, []

    def watch():
        items = received()
        seen.extend(frame.fields for data in items for frame in acks.feed(data) if frame.name == "COMMAND_ACK")
        return items

    bench.tap.receive = watch
    bench.to("failed", 80.0)
    verdicts = [ack.result for ack in seen if ack.command == px4.Command.DO_SET_MODE]
    assert verdicts[:2] == [px4.Result.ACCEPTED, px4.Result.TEMPORARILY_REJECTED]
    (text,) = bench.reported("OFFBOARD was refused")
    assert "Switching to Offboard is currently not available" in text
    assert not bench.sim.flight.armed and not bench.sent


def test_a_px4_left_in_offboard_is_armed_with_set_points():
    """After a landing PX4 falls back to OFFBOARD, where it refuses to arm without a stream."""
    bench = Bench().to("parameters")
    bench.theirs.peer.send(Packer(245, 190).send_name("COMMAND_LONG", 1, 1, 176, 0, 1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    bench.to("hover")
    modes = [text for text in bench.texts if text.startswith("mode ")]
    assert modes == ["mode AUTO.LOITER", "mode OFFBOARD"]
    assert not bench.reported("denied")


def test_missing_heartbeats_are_reported_while_control_continues():
    """Whether to go on without HEARTBEATs is the caller's choice: odometry still comes, so the driver obeys."""
    bench = Bench().to("hover")
    bench.run(0.5, hover)
    bench.sim.set_heartbeat(False)
    bench.run(2.0, hover)
    assert bench.out.connected
    bench.run(2.1, hover)
    assert not bench.out.connected
    assert [note.severity for _, note in bench.notes if "no HEARTBEAT" in note.text] == ["error"]
    assert bench.link.phase == "handed_over"
    bench.sim.set_heartbeat(True)
    bench.run(1.1, hover)
    assert bench.out.connected
    assert len(bench.reported("no HEARTBEAT")) == 1


def test_missing_odometry_gives_no_new_samples():
    """The gate decides on the age of the newest sample, so no sample may be repeated with a new stamp."""
    bench = Bench().to("hover")
    bench.run(0.5, hover)
    ours = Parser()
    receive = bench.tap.receive
    keep = lambda data: all(frame.name != "ODOMETRY" for frame in ours.feed(data))  # noqa: E731
    bench.tap.receive = lambda: [data for data in receive() if keep(data)]
    bench.run(0.05, hover)
    count, last = len(bench.odometry), bench.odometry[-1][1].stamp_ns
    bench.run(1.0, hover)
    assert len(bench.odometry) == count
    assert bench.now - last > 1_000 * MS
