"""What a service of the software PX4 needs of the link that a message came on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from vehicle.px4.codec import Frame, MessageType


class Link(Protocol):
    """A port; see `vehicle.px4.sim.port.Port`."""

    def send(self, message: MessageType, *values: Any) -> None: ...


Handler = Callable[[Any, Frame, Any], None]
"""Takes a link, the frame and its fields."""
