"""The commands of a recorded run, flown again: a policy that asks at each moment what was sent then."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from policies.task.interface import BoardView, Command, Vec3, VehicleView


class Playback:
    """A `FlyingPolicy`. `commands`: (ns since the attempt's start, body rate rad/s FLU, thrust m/s^2), in order."""

    def __init__(self, commands: Sequence[tuple[int, Vec3, float]]) -> None:
        """Raises ValueError without commands."""
        if not commands:
            raise ValueError("nothing was sent to the vehicle during the attempt")
        self._commands = commands
        self._times = [at_ns for at_ns, _, _ in commands]
        self._start_ns = 0

    def reset(self, now_ns: int) -> None:
        self._start_ns = now_ns

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command:
        place = bisect_right(self._times, now_ns - self._start_ns) - 1
        if place < 0:
            return Command(False, (0.0, 0.0, 0.0), 9.81, "waits", 1.0)
        _, body_rate, thrust = self._commands[place]
        return Command(True, body_rate, thrust, "recorded", 1.0)

    def flown(self, body_rate: Vec3, thrust: float) -> None:
        """Nothing acts on what was sent already."""
