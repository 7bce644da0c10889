"""Messages with any content into a flying software PX4: it answers or ignores them, and its state stays finite."""

import math
import struct

from tests.attack.forged import FACTOR, rng
from tests.unit.vehicle.px4.sim.client import Rig
from vehicle.px4.codec import MESSAGES
from vehicle.px4.sim.services.plan import FENCE, MISSION, RALLY, Item

MISSION_MESSAGES = (
    "MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ITEM", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT",
    "MISSION_REQUEST", "MISSION_CLEAR_ALL", "MISSION_SET_CURRENT", "MISSION_ACK",
)  # fmt: skip
OTHERS = ("FILE_TRANSFER_PROTOCOL", "LOG_REQUEST_LIST", "MANUAL_CONTROL", "COMMAND_INT", "COMMAND_LONG")
FLOATS = (0.0, -1.0, 1.0, 3.0, 1e9, -1e30, math.nan, math.inf, -math.inf)
FLOWN = (16, 17, 19, 20, 21, 22, 31, 34, 93, 177, 178, 192, 300)
WHOLE = (0, 1, 2, 3, 5, 6, 190, 245, 255, 65535, 2**31 - 1, 0x7FF80000)


def any_frame(name, random):
    """Fields that mean something as often as not, addressed to the autopilot."""
    message = MESSAGES[name]
    payload = bytearray(random.randbytes(message.size))
    fields = message.decode(bytes(payload))._asdict()
    for field, value in fields.items():
        if field.startswith("target"):
            fields[field] = 1
        elif isinstance(value, float):
            fields[field] = random.choice(FLOATS)
        elif field == "command":
            fields[field] = random.choice(FLOWN)
        elif isinstance(value, int) and random.random() < 0.7:
            fields[field] = random.choice(WHOLE)
    try:
        return list(fields.values()) if message.payload(list(fields.values())) else []
    except (struct.error, OverflowError):
        return [1 if field.startswith("target") else 0 for field in fields]


def test_no_message_breaks_the_services_or_the_flight():
    random = rng("px4 services")
    rig = Rig().fly_to_hover()
    for _ in range(600 * FACTOR):
        name = random.choice((*MISSION_MESSAGES, *OTHERS))
        values = any_frame(name, random)
        if all(isinstance(value, int | float | tuple) for value in values):
            rig.send(name, *values)
        rig.run(12)
        rig.log.clear()
        assert all(map(math.isfinite, rig.flight.row.tolist()))
    assert set(rig.flight.plan.items) == {MISSION, FENCE, RALLY}


def test_no_mission_breaks_the_flight():
    random = rng("px4 missions")
    for seed in range(8 * FACTOR):
        rig = Rig(seed=seed)
        items = []
        for _ in range(random.randrange(1, 8)):
            command = random.choice((16, 17, 19, 20, 21, 22, 31, 93, 177, 178, 2000))
            params = tuple(random.choice((*FLOATS, 0.0, 1.0)) for _ in range(4))
            place = [round(1e7 * degrees) + random.randrange(-3000, 3000) for degrees in (47.397742, 8.545594)]
            items.append(Item(6 if command < 90 else 2, command, 0, 1, params, *place, random.choice((*FLOATS, 3.0))))
        rig.flight.plan.store(MISSION, tuple(items))
        assert rig.ask(300, 0.0, 0.0)[-1] == 0
        rig.run(8000)
        assert all(map(math.isfinite, rig.flight.row.tolist())), items
        assert 0 <= rig.flight.plan.current < len(items)
