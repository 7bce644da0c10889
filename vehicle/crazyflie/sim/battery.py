"""A Crazyflie's 250 mAh cell: its voltage falls with the charge taken, and under load."""

from __future__ import annotations

FULL_V, EMPTY_V = 4.15, 3.3  # without load
SAG_V = 0.35  # at full thrust
ENDURANCE_S = 330.0  # at hover; the product page says 7 minutes without payload
_HOVER = 0.65  # thrust over full thrust

BATTERY, LOW_POWER = 0, 3  # pm.state
LOW_V = 3.2  # pm.lowVoltage


class Battery:
    """`use` takes charge; `voltage` is what its clamps show."""

    def __init__(self, charge: float = 1.0) -> None:
        """`charge`: 0 empty .. 1 full."""
        self.charge, self.voltage = charge, 0.0
        self.use(0.0, 0.0)

    def use(self, thrust: float, seconds: float) -> None:
        """`thrust`: mean thrust of the motors over their full thrust, during `seconds`."""
        self.charge = max(0.0, self.charge - thrust / _HOVER * seconds / ENDURANCE_S)
        self.voltage = EMPTY_V + (FULL_V - EMPTY_V) * self.charge - SAG_V * thrust

    @property
    def state(self) -> int:
        return LOW_POWER if self.voltage < LOW_V else BATTERY
