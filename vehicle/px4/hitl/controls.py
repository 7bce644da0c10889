"""HIL_ACTUATOR_CONTROLS: what the firmware asks of the motors, checked before it moves anything."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vehicle.px4.protocol import BaseMode

LOCKSTEP = 1  # bit of flags
MOTORS = 4
_SLACK = 1e-3  # PX4 gives its outputs in steps of this


class MotorControls:
    """The last valid controls. PX4's quad X has the motors in our mixer's order: front right, rear left, front left,
    rear right; its outputs of a linear thrust curve (THR_MDL_FAC 0) are shares of full thrust.

    `take_faults` gives each fault once, as a text.
    """

    def __init__(self) -> None:
        self.motors = np.zeros(MOTORS)
        self.armed = self.lockstep = self.hil = False
        self.time_us = -1  # of the firmware's clock
        self.count = self.rejected = 0
        self._faults: dict[str, bool] = {}  # text: taken

    def receive(self, fields: Any) -> None:
        """One message. One that is not finite or older than the last is rejected; one out of range is clipped."""
        if fields.time_usec < self.time_us:
            self._reject(f"its clock ran back by {(self.time_us - fields.time_usec) * 1e-6:.3f} s: it has restarted")
            return
        if not all(map(math.isfinite, fields.controls)):
            self._reject("actuator controls that are not finite; the motors keep their last ones")
            return
        self.time_us, self.count = fields.time_usec, self.count + 1
        self.lockstep = bool(fields.flags & LOCKSTEP)
        self.hil = bool(fields.mode & BaseMode.HIL)
        self.armed = bool(fields.mode & BaseMode.ARMED)
        asked = fields.controls[:MOTORS]
        if min(asked) < -_SLACK or max(asked) > 1.0 + _SLACK:
            self._fault(f"actuator controls out of 0..1 ({min(asked):.2f} to {max(asked):.2f}); they are clipped")
        if self.armed and any(abs(value) > _SLACK for value in fields.controls[MOTORS:]):
            used = max(i for i, value in enumerate(fields.controls) if abs(value) > _SLACK) + 1
            self._fault(f"it drives output {used}; the airframe has {MOTORS} motors: set CA_ROTOR_COUNT")
        self.motors[:] = [min(1.0, max(0.0, value)) for value in asked] if self.armed else 0.0

    def take_faults(self) -> list[str]:
        """What was wrong and has not been taken yet."""
        new = [text for text, taken in self._faults.items() if not taken]
        self._faults.update(dict.fromkeys(new, True))
        return new

    def _reject(self, text: str) -> None:
        self.rejected += 1
        self._fault(text)

    def _fault(self, text: str) -> None:
        if len(self._faults) < 8:
            self._faults.setdefault(text, False)
