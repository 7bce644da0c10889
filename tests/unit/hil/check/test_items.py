"""A healthy simulated rig passes every item of the preflight; what cannot be read is unknown, not failed."""

import pytest

from hil.bench.reading import NotApplicable, Unavailable
from hil.check.judge import Outcome
from tests.unit.hil.check.preflight import ITEMS, result, roomy, with_slot

HEALTHY = [key for key in ITEMS if key[0] not in ("host.bus",) and ITEMS[key].when != "real"]


@pytest.mark.parametrize("key", HEALTHY, ids=[" ".join(key).strip() for key in HEALTHY])
def test_a_healthy_simulated_rig_passes_every_item_of_the_preflight(healthy, key, monkeypatch):
    roomy(monkeypatch, gigabytes=100.0)
    try:
        judged = result(healthy, key[0], **({"name": key[1]} if key[1] else {}))
    except NotApplicable as error:
        assert ("built in" in str(error)) is key[0].startswith("policy.")
        assert ("no earlier flight" in str(error)) is (key[0] == "vehicle.parameters_changed")
        assert ("one clock" in str(error)) is (key[0] in ("host.clock", "host.date"))
    else:
        assert judged.outcome in (Outcome.PASS, Outcome.MARGINAL), judged


def test_a_device_this_program_cannot_read_is_unknown(context):
    real = with_slot(context, "vehicle", kind="udp")
    with pytest.raises(Unavailable, match='vehicle of kind "udp"'):
        result(real, "vehicle.heartbeat")
