"""A camera that is not simulated: a device, or the playback of a recording."""

from __future__ import annotations

from hil.contract.messages import Event, Image, Stage
from hil.contract.node import Inbox, Node, Out
from hil.wires import WireError
from hil.wires.camera import CameraWire

_POLL_NS = 2_000_000


class CameraDevice(Node):
    """Passes the newest picture on, from the lead stage on (no picture is used before).

    A device that is lost is reported by an event, and the next step ends the service: without pictures the attempt
    cannot succeed, and every other service then enters its safe state. The end of a recording is only reported.
    """

    name = "camera"
    inputs = ("run/stage",)
    outputs = ("camera/image", "event")
    wakes = ("run/stage",)  # a node that is woken is stepped at the time that it is, not at its deadline
    period_ns = _POLL_NS

    def __init__(self, camera: CameraWire, exposure_ns: int, real: bool = True) -> None:
        """`real`: a device, not a recording."""
        self._camera, self._exposure_ns, self._real = camera, exposure_ns, real
        self._lost = ""

    @property
    def counters(self) -> dict[str, int]:
        return {
            "pictures replaced before they were read": self._camera.dropped,
            "damaged pictures": self._camera.damaged,
            "cameras lost": int(bool(self._lost)),
        }

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        if self._lost and self._real:
            raise WireError(self._lost)
        stage: Stage | None = inbox.latest("run/stage")
        if self._lost or (stage is not None and stage.name == "ended"):
            return []
        self._lost = self._camera.lost
        if self._lost:
            return [Out("event", Event(now_ns, "error" if self._real else "warning", self.name, self._lost))]
        if stage is None or stage.name == "prepare":
            return []
        picture = self._camera.take(now_ns)
        if picture is None:
            return []
        height, width = picture.pixels.shape
        image = Image(
            now_ns - picture.age_ns, width, height, self._exposure_ns, picture.pixels.tobytes(), picture.sequence
        )
        return [Out("camera/image", image)]

    def close(self) -> None:
        self._camera.close()
