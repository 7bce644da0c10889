"""The simulated car's feedback: CAN frames at their cycles, and the battery model whose values they carry."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from groundcar.motion.kinematics import wheel_speeds
from groundcar.scout import car_row
from groundcar.scout.codec import Frame, can_id, encode
from groundcar.scout.params import Battery as BatteryParams
from groundcar.scout.params import Geometry
from kernel.random import uniform

MS = 1_000_000
CYCLES_NS = {
    "SystemState": 100 * MS,
    "MotionState": 20 * MS,
    "Odometry": 20 * MS,
    "LightState": 20 * MS,
    "RcState": 20 * MS,
    **{f"Motor{k}": 20 * MS for k in (1, 2, 3, 4)},
    **{f"Driver{k}": 20 * MS for k in (1, 2, 3, 4)},
    "Bms": 100 * MS,  # assumed: the manual gives no cycle
}
_IDS = {name: can_id(name) for name in CYCLES_NS}
ROLLING = 0.03  # rolling resistance over weight, assumed


class Battery:
    """State of charge and voltage; open-circuit voltage is taken as linear in charge down to the fault threshold."""

    def __init__(self, params: BatteryParams, spread: float, stream: np.ndarray) -> None:
        self._params = params
        self.current = params.idle_current
        self.set_voltage(min(params.full, params.start + float(uniform(stream, -spread, spread))))

    def set_voltage(self, volts: float) -> None:
        """Charge or discharge it to an open-circuit voltage."""
        self.charge = (volts - self._params.fault) / (self._params.full - self._params.fault)

    @property
    def voltage(self) -> float:
        """Under the present load, V."""
        p = self._params
        return p.fault + (p.full - p.fault) * self.charge - p.resistance * self.current

    @property
    def empty(self) -> bool:
        """Below the voltage at which the car stops itself."""
        return self.voltage < self._params.fault

    @property
    def low(self) -> bool:
        """Below the voltage at which the car warns."""
        return self.voltage < self._params.warning

    def use(self, acceleration: float, speed: float, dt: float) -> None:
        """Draw the current that driving takes for `dt` s."""
        p = self._params
        rolling = ROLLING * 9.81 * min(1.0, abs(speed) / 0.1)
        self.current = p.idle_current + p.current_per_newton * p.mass * (abs(acceleration) + rolling)
        self.charge -= self.current * dt / (3600.0 * p.capacity)


class FeedbackSender:
    """Sends each message when its cycle is due."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = geometry
        self._next_ns: dict[str, int] = {}
        self._soonest_ns = -(2**63)  # of all cycles
        self._last: dict[str, tuple[dict[str, float], bytes]] = {}
        self._count = 0
        self.light: dict[str, float] = {}
        self.muted: frozenset[str] = frozenset()

    def due(self, name: str, now_ns: int) -> bool:
        """True once a cycle; cycles that were missed are not sent later."""
        cycle, due = CYCLES_NS[name], self._next_ns.get(name, now_ns)
        if now_ns < due:
            return False
        self._next_ns[name] = due + cycle if now_ns < due + cycle else now_ns + cycle
        return name not in self.muted

    def send(
        self,
        wire: Any,
        now_ns: int,
        state: np.ndarray,
        system: int,
        mode: int,
        faults: dict[tuple[str, int], bool],
        battery: Battery,
    ) -> None:
        """`state` is a row of groundcar.scout.physics, `system` and `mode` are 0x211's."""
        if now_ns < self._soonest_ns:
            return
        left, right = wheel_speeds(state[car_row.WHEEL_SPEED], state[car_row.WHEEL_TURN], self._geometry.track)
        per_metre = 60.0 / (2.0 * math.pi * self._geometry.wheel_radius)
        for name in CYCLES_NS:
            if not self.due(name, now_ns):
                continue
            values: dict[str, float] = {}
            if name == "SystemState":
                self._count = (self._count + 1) % 256
                values = {"state": system, "mode": mode, "battery": battery.voltage, "count": self._count}
                values |= {"under_voltage": battery.empty, "under_voltage_warning": battery.low}
            elif name == "MotionState":
                values = {"speed": float(state[car_row.WHEEL_SPEED]), "turn_rate": float(state[car_row.WHEEL_TURN])}
            elif name == "Odometry":
                values = {"left": float(state[car_row.LEFT]), "right": float(state[car_row.RIGHT])}
            elif name == "LightState":
                values = self.light
            elif name == "Bms":
                values = {"charge": 100.0 * battery.charge, "health": 100, "voltage": battery.voltage}
                values |= {"current": -battery.current, "temperature": 25.0}
            elif name.startswith("Motor"):  # 1 right front, 2 left front, 3 left rear, 4 right rear (assumed)
                side, rolled = (
                    (right, state[car_row.RIGHT]) if name in ("Motor1", "Motor4") else (left, state[car_row.LEFT])
                )
                pulses = int(rolled * self._geometry.pulses_per_metre)
                values = {"rpm": float(side) * per_metre, "current": battery.current / 4.0, "pulses": pulses}
            elif name.startswith("Driver"):
                values = {"voltage": battery.voltage, "driver_temperature": 35, "motor_temperature": 35}
                values |= {fault: 1 for fault, wheel in faults if name == f"Driver{wheel}"}
            wire.send(self._frame(name, values))
        self._soonest_ns = min(self._next_ns.values())

    def _frame(self, name: str, values: dict[str, float]) -> Frame:
        """The frame of message `name`; its data are those of the last message of its kind if that said the same."""
        kind = name.rstrip("1234")
        last = self._last.get(kind)
        if last is None or last[0] != values:
            last = self._last[kind] = dict(values), encode(name, values).data
        return Frame(_IDS[name], last[1])
