"""The simulated vehicle that a real firmware flies."""

from __future__ import annotations

from hil.contract.messages import Event
from hil.contract.node import Inbox, Out
from hil.nodes.vehicle_device import VehicleDevice
from hil.wires import WireError
from vehicle.px4.hitl.device import FirmwareFault, HitlVehicle
from vehicle.quadrotor.wind import Wind


class FirmwareVehicle(VehicleDevice):
    """`VehicleDevice` behind PX4's simulator interface: its steps wait for the firmware, whose faults are events."""

    outputs = (*VehicleDevice.outputs, "event")

    def __init__(self, body: HitlVehicle, wind: Wind | None = None) -> None:
        super().__init__(body, wind)
        self.body = body

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        """Raises WireError for a firmware that has gone, does not answer or must not be flown: the run ends."""
        try:
            outs = super().step(now_ns, inbox)
        except FirmwareFault as error:
            raise WireError(str(error)) from None
        notes = self.body.take_notes()
        return outs + [Out("event", Event(now_ns, "warning", self.name, f"firmware: {text}")) for text in notes]

    @property
    def counters(self) -> dict[str, int]:
        return {
            "steps that the firmware did not answer": self.body.unanswered,
            "actuator controls that were refused": self.body.controls.rejected,
        }
