"""What the server's process is told: passed to it as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vehicle.camera.lens import Lens
from vehicle.camera.pinhole import Camera


@dataclass(frozen=True)
class ServerSpec:
    """Configuration of the process: `port` of loopback (0: a free one), the bus's `endpoint` and folder of `keys`
    (empty: it is open), the run's `name`, the board's size (m), the calibrated `camera` as `dataclasses.asdict` has it.
    """

    port: int
    endpoint: str
    keys: str
    name: str
    board_size: float
    camera: dict[str, Any]

    def calibrated(self) -> Camera:
        """The camera."""
        lens = Lens(self.camera["lens"]["model"], tuple(self.camera["lens"]["coefficients"]))
        return Camera(**{**self.camera, "lens": lens, "offset": tuple(self.camera["offset"])})
