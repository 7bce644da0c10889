from types import SimpleNamespace

from hil.contract.messages import BoardState, Contact
from hil.nodes.vehicle_device import VehicleDevice
from tests.unit.hil.contract.node_fakes import filled

NOW = 1_000_000_000


def contact(outcome, attached=False):
    return "referee/contact", Contact(NOW, outcome, "", attached, attached, 0.0, 0.0, 0.0, 0.0, 0.0)


class FakeSim:
    """Notes where it is attached and how far it is stepped."""

    def __init__(self):
        self.calls = []

    def attach(self, position, orientation, stamp_ns, velocity, turn_rate):
        self.calls.append(("attach", position, stamp_ns, velocity, turn_rate))

    def step(self, now_ns):
        self.calls.append(("step", now_ns))

    def truth(self):
        return SimpleNamespace(
            position=(1.0, 2.0, 3.0), velocity=(0.0,) * 3, orientation=(1.0, 0.0, 0.0, 0.0), body_rate=(0.0,) * 3
        )


def test_simulated_vehicle_moves_with_the_board_once_attached():
    sim = FakeSim()
    node = VehicleDevice(sim)
    board = BoardState(0, (4.0, 5.0, 1.5), (2.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 0.0, 2.0, 0.3)
    for verdict in ((), (contact("ongoing"),), (contact("fail"),), (contact("success", attached=True),)):
        (out,) = node.step(NOW, filled(node, ("truth/board", board), *verdict))
        assert (out.topic, out.message.stamp_ns, out.message.position) == ("truth/vehicle", NOW, (1.0, 2.0, 3.0))
    assert sim.calls == [("step", NOW)] * 3 + [
        ("attach", (4.0, 5.0, 1.5), 0, (2.0, 0.0, 0.0), 0.3),
        ("step", NOW),
    ]
