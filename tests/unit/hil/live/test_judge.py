"""A live run's class says of the motors only what the recording shows."""

from types import SimpleNamespace

import pytest

from hil.assembly.plan import Plan
from hil.contract import messages as m
from hil.live.judge import Ended, judge
from hil.recording.recorder import Recorder
from hil.scoring.flight_class import ABORTED, LAND_LIMIT_S, UNSAFE

S = 1_000_000_000
PLAN = Plan("simple-i", "sim", None, "model")
LEVEL, ZERO = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


def flight_class(folder, *, recorded_s, disarmed_s=1e9, connected_s=1e9):
    """The class of a run that is aborted after 2 s; its recording ends `recorded_s` later."""
    with Recorder(folder / "run.mcap") as tap:
        tap(0, "run/stage", m.Stage(0, "attempt", 1, 1))
        tap(2 * S, "event", m.Event(2 * S, "warning", "supervisor", "run aborted: hub does not answer"))
        for second in range(3 + recorded_s):
            after_s, now_ns = second - 2, second * S
            armed, connected = after_s < disarmed_s, after_s < connected_s
            tap(now_ns, "truth/vehicle", m.VehicleState(now_ns, ZERO, ZERO, LEVEL, ZERO))
            status = m.VehicleStatus(now_ns, connected, armed, False, False, "OFFBOARD", "landing", 15.0, 0.5)
            tap(now_ns, "vehicle/status", status)
    ended = Ended()
    ended.trouble = "hub does not answer"
    return judge(SimpleNamespace(recording=folder / "run.mcap"), PLAN, 0, ended)[2]


@pytest.mark.parametrize(
    ("how", "name"),
    [
        ({"recorded_s": 10, "disarmed_s": 8}, ABORTED),
        ({"recorded_s": int(LAND_LIMIT_S)}, UNSAFE),
        ({"recorded_s": 3}, None),  # the hub was lost: nothing is recorded of the landing
        ({"recorded_s": int(LAND_LIMIT_S), "connected_s": 5}, None),
    ],
)
def test_motors_run_on_only_where_the_recording_says_so(tmp_path, how, name):
    found = flight_class(tmp_path, **how)
    assert (found.name if found else None) == name
