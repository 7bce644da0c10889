"""The log protocol of a PX4 that keeps no log."""

from __future__ import annotations

from typing import Any

from vehicle.px4.codec import MESSAGES as M
from vehicle.px4.codec import Frame
from vehicle.px4.sim.services.partner import Handler, Link


class Logs:
    """Answers a request for the list with the entry that stands for an empty one; there is no data to ask for."""

    @property
    def handlers(self) -> dict[str, Handler]:
        """By message name."""
        return {"LOG_REQUEST_LIST": self._on_list}

    def _on_list(self, link: Link, frame: Frame, m: Any) -> None:
        link.send(M["LOG_ENTRY"], 0, 0, 0, 0, 0)
