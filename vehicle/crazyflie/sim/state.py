"""The state that the parts of the software Crazyflie share."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kernel.rotations import yaw
from vehicle.crazyflie.commands import FULL_WORD, Quat, Vec3
from vehicle.crazyflie.sim.battery import Battery
from vehicle.crazyflie.sim.commander import Commander
from vehicle.crazyflie.sim.estimator import Estimator
from vehicle.crazyflie.sim.high_level import IDLE
from vehicle.crazyflie.sim.supervisor import Supervisor
from vehicle.crazyflie.thrust import FULL_FORCE
from vehicle.px4.sim.rows import control, estimate, situation
from vehicle.quadrotor import state_row


@dataclass
class Flight:
    """`row`: the vehicle's true state; `full_force`: N per motor at command 1, as its control assumes. `now_ns` since
    boot."""

    row: np.ndarray
    full_force: float
    supervisor: Supervisor
    commander: Commander
    estimator: Estimator
    battery: Battery
    control: np.ndarray = field(default_factory=lambda: np.full(control.LENGTH, np.nan))
    estimate: np.ndarray = field(default_factory=lambda: np.zeros(estimate.LENGTH))
    body: np.ndarray = field(default_factory=lambda: np.zeros(situation.LENGTH))
    now_ns: int = 0

    @property
    def position(self) -> Vec3:
        """Estimated position, m, world."""
        x, y, z = self.estimate[estimate.POSITION : estimate.POSITION + 3].tolist()
        return x, y, z

    @property
    def heading(self) -> float:
        """Estimated heading, rad."""
        return float(yaw(_quaternion(self.estimate, estimate.ATTITUDE)))

    @property
    def word(self) -> float:
        """The thrust word that the control loops ask for (log variable stabilizer.thrust)."""
        return float(self.control[control.OUT_THRUST]) * self.full_force / FULL_FORCE * FULL_WORD

    @property
    def info(self) -> int:
        """The supervisor's bits."""
        high_level = self.commander.high_level
        return self.supervisor.info(high_level.state != IDLE, high_level.finished(self.now_ns))

    def take_pose(self, position: Vec3, orientation: Quat | None) -> None:
        """An external pose for the estimator: m and quaternion (w x y z), world."""
        x, y, z = self.row[state_row.P : state_row.P + 3].tolist()
        self.estimator.take(self.now_ns, position, orientation, (x, y, z), _quaternion(self.row, state_row.Q))


def _quaternion(row: np.ndarray, at: int) -> Quat:
    w, x, y, z = row[at : at + 4].tolist()
    return w, x, y, z
