import pytest


class End:
    """One end of a CAN bus in memory; frames arrive at once."""

    def __init__(self):
        self.inbound, self.sent = [], []

    def send(self, frame):
        self.sent.append(frame)
        self.peer.inbound.append(frame)

    def receive(self):
        frames, self.inbound = self.inbound, []
        return frames


@pytest.fixture
def bus():
    """Two ends: ours and the car's."""
    ours, car = End(), End()
    ours.peer, car.peer = car, ours
    return ours, car
