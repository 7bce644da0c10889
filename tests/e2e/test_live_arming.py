"""What a go is bound to, in a whole live run: an autopilot that is not as it was checked is not armed.

Nothing here flies, so that it needs no quiet machine.
"""

import pytest

from hil.assembly.plan import Plan
from hil.live.run import fly_live
from hil.recording import provenance
from tests.e2e.test_live_px4 import autopilot, event_texts
from tests.e2e.test_live_px4 import site as px4_site
from vehicle.px4.driver.arming import Arming

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300), pytest.mark.usefixtures("real_time")]
site = px4_site


def test_autopilot_that_holds_another_value_than_checked_is_not_armed(site, tmp_path):
    port, names = site
    checked = Arming(parameters={"COM_OF_LOSS_T": 0.3, "NAV_RCL_ACT": 6})
    with autopilot(port, 0.97) as report:
        live = fly_live(
            Plan(**names), names, 0, pictures="none", out=tmp_path / "runs", code=provenance.code(),
            progress=lambda now_ns, stage: None, arming=checked,
        )  # fmt: skip
    failure, run = live.flight.failure, live.flight.run
    assert failure.startswith("the vehicle did not reach its start (failed): not armed, ")
    assert "NAV_RCL_ACT is 2, checked was 6" in failure and "COM_OF_LOSS_T" not in failure
    assert len(failure.splitlines()) == 1
    assert (run.manifest["state"], live.flight.score.verdict) == ("failed", "incomplete")
    assert "mode AUTO.TAKEOFF" not in event_texts(run)
    assert (report["armed"], report["armed_now"]) == (0, False)
