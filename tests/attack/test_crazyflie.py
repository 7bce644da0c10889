"""Damaged and foreign packets into the software Crazyflie: it answers, counts or ignores them, and goes on."""

import math

from tests.attack.forged import FACTOR, damaged, rng
from tests.unit.vehicle.crazyflie.sim.client import Rig
from vehicle.crazyflie import commands
from vehicle.crazyflie.commands import GoTo, Rates, Vertical
from vehicle.crazyflie.crtp import MOST_DATA, Packet, SupervisorCommand, pack


def test_no_bytes_break_the_software_crazyflie():
    random = rng("crazyflie")
    rig = Rig()
    rig.arm()
    whole = [
        pack(commands.rates(Rates((0.1, 0.2, 0.3), 40000))),
        pack(commands.vertical(Vertical(False, 1.0, None, 2.0))),
        pack(commands.go_to(GoTo(False, (1.0, 0.0, 1.0), 0.0, 2.0))),
        pack(commands.external_pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))),
        pack(commands.supervisor(SupervisorCommand.ARM, 1)),
        pack(commands.relax()),
    ]
    for _ in range(400 * FACTOR):
        kind = random.randrange(3)
        if kind == 0:
            data = damaged(random.choice(whole), random)
        elif kind == 1:
            data = pack(
                Packet(random.randrange(16), random.randrange(4), random.randbytes(random.randrange(MOST_DATA)))
            )
        else:
            data = random.randbytes(random.randrange(40))
        rig.wire.send(bytes(data))
        rig.run(4)
        assert all(len(packet.data) <= MOST_DATA for packet in rig.received)
        rig.received.clear()
        assert all(map(math.isfinite, rig.flight.row.tolist()))
