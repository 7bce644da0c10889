"""The driver and the software Crazyflie at both ends of a wire in memory, with motion capture."""

from hil.contract.wire import memory_pair
from vehicle.crazyflie.driver.driver import CrazyflieLink
from vehicle.crazyflie.driver.types import CrazyflieConfig
from vehicle.crazyflie.sim.crazyflie import CrazyflieSim
from vehicle.px4.driver.types import ExternalPose, Rates
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

MS = 1_000_000
HERE = (1.0, -0.5, 0.0)
START = (0.4, 0.3, 1.6, 0.5)
HOVER = Rates((0.0, 0.0, 0.0), GRAVITY)


class Tap:
    """Our end of the wire: stores what is sent, drops it while `stopped`."""

    def __init__(self, wire):
        self._wire, self.sent, self.stopped, self.deaf = wire, [], False, False

    def send(self, data):
        self.sent.append(data)
        if not self.stopped:
            self._wire.send(data)

    def receive(self):
        data = self._wire.receive()
        return [] if self.deaf else data


class Bench:
    """`run` steps both; `poses` is whether motion capture feeds the driver."""

    def __init__(self, config=None, **options):
        frame = load_airframe("crazyflie")
        self.now, self.poses, self.ended = 0, True, False
        ours, theirs = memory_pair(lambda: self.now, 1 * MS)
        self.wire = Tap(ours)
        self.sim = CrazyflieSim(theirs, frame, 1, HERE, 0.3, **options)
        self.link = CrazyflieLink(self.wire, CrazyflieConfig(START, frame.body.mass, **(config or {})))
        self.notes, self.odometry, self.output = [], [], None
        self.sim.step(0)

    @property
    def phase(self):
        return self.link.phase

    def run(self, ms, command=None):
        end = self.now + ms * MS
        while self.now < end:
            self.step(command)

    def step(self, command=None):
        self.now += 2 * MS
        self.sim.step(self.now)
        pose = None
        if self.poses and self.now // MS % 10 == 0:
            truth = self.sim.truth()
            pose = ExternalPose(self.now, truth.position, truth.orientation)
        due = command is not None and self.now // MS % 10 == 0
        self.output = self.link.step(self.now, command if due else None, pose)
        self.notes += self.output.notes
        self.odometry += [(self.now, sample, self.sim.truth()) for sample in self.output.odometry]

    def until(self, phase, seconds=40):
        end = self.now + seconds * 1000 * MS
        while self.phase != phase and self.now < end:
            self.step()
        assert self.phase == phase, (self.phase, self.texts())
        return self

    def texts(self):
        return [note.text for note in self.notes]
