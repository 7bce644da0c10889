"""The wires of a live run: UDP on this host for simulated devices, the rig's addresses for real ones."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from hil.assembly.hitl import HitlWires, free_instance, offboard_url
from hil.assembly.rig import Rig
from hil.wires import WireError
from hil.wires.can import open_can
from hil.wires.can_udp import CanOverUdp
from hil.wires.crazyradio import CrazyradioWire
from hil.wires.serial import SerialWire
from hil.wires.tcp import TcpWire
from hil.wires.udp import UdpWire
from hil.wires.url import open_url

_LOCAL = "127.0.0.1"


class Ports(BaseModel):
    """UDP ports of the wires between simulated devices and their drivers."""

    model_config = ConfigDict(frozen=True)

    vehicle_link: int
    vehicle_device: int
    car_link: int
    car_device: int
    host: str = _LOCAL
    firmware: int = 0  # instance of the firmware that this run starts


def free_ports(rig: Rig) -> Ports:
    """Ports that are free now. Raises WireError if those of a firmware are not."""
    instance = free_instance(rig.vehicle)
    with socket.socket() as a, socket.socket() as b, socket.socket() as c, socket.socket() as d:
        found: list[int] = []
        for one in (a, b, c, d):
            one.bind((_LOCAL, 0))
            found.append(one.getsockname()[1])
    link, device, car_link, car_device = found
    return Ports(vehicle_link=link, vehicle_device=device, car_link=car_link, car_device=car_device, firmware=instance)


class LiveWires:
    """Opens a wire when its node is built; `close` closes all opened ones. Raises WireError if a device is missing."""

    def __init__(self, rig: Rig, ports: Ports) -> None:
        self._rig, self._ports = rig, ports
        self._opened: list[Any] = []
        self._connections: list[TcpWire | SerialWire | CrazyradioWire] = []
        self._hitl: HitlWires | None = None
        self.descriptors: dict[int, str] = {}  # to be waited for -> the driver that reads it; others are looked at

    def vehicle_system(self) -> int:
        return self._rig.vehicle.system + self._ports.firmware

    def vehicle_link(self) -> Any:
        slot, ports = self._rig.vehicle, self._ports
        if slot.kind == "crazyflie":
            return self._keep(CrazyradioWire(slot.url), "vehicle_link")
        if slot.kind == "crazyflie-sim":  # the client sends first
            peer = (ports.host, ports.vehicle_device)
            return self._keep(UdpWire((ports.host, ports.vehicle_link), peer, partner="fixed"), "vehicle_link")
        if slot.kind != "sim":
            return self._keep(open_url(offboard_url(slot, ports.firmware), self.vehicle_system()), "vehicle_link")
        return self._keep(UdpWire((ports.host, ports.vehicle_link), partner="first"), "vehicle_link")

    def vehicle_device(self) -> Any:
        ports = self._ports
        if self._rig.vehicle.kind == "hitl":
            hitl = self._hitl = HitlWires(self._rig.vehicle, ports.firmware)
            self._keep(hitl)
            return hitl.simulator
        # as PX4 does: sends first to a default address, keeps its first partner, receives from any sender
        peer = (ports.host, ports.vehicle_link)
        return self._keep(UdpWire((ports.host, ports.vehicle_device), peer, partner="first", accept_others=True))

    def car_link(self) -> Any:
        slot, ports = self._rig.groundcar, self._ports
        if slot.kind == "can":
            if slot.interface == "virtual":
                raise WireError("a virtual CAN bus ends at its process: in a live run use socketcan or udp_multicast")
            return self._keep(open_can(slot.interface, slot.channel))
        return self._keep(self._can(ports.car_link, ports.car_device))

    def car_device(self) -> Any:
        return self._keep(self._can(self._ports.car_device, self._ports.car_link))

    def _can(self, here: int, there: int) -> CanOverUdp:
        host = self._ports.host
        return CanOverUdp(UdpWire((host, here), (host, there), partner="fixed"))

    def _keep(self, wire: Any, driver: str = "") -> Any:
        self._opened.append(wire)
        if isinstance(wire, TcpWire | SerialWire | CrazyradioWire):
            self._connections.append(wire)
        if driver and isinstance(wire, UdpWire):
            self.descriptors[wire.fileno()] = driver
        return wire

    def start(self, folder: Path) -> None:
        """Start what runs beside this process; what it leaves goes into `folder`. Raises WireError."""
        if self._hitl is not None:
            self._hitl.start(folder)

    @property
    def remarks(self) -> list[str]:
        """What of the opened wires is slower than it could be."""
        return [wire.remark for wire in self._connections if isinstance(wire, SerialWire) and wire.remark]

    @property
    def trouble(self) -> list[str]:
        """Wires that were lost."""
        connections = [*self._connections, *([self._hitl] if self._hitl is not None else [])]
        return [wire.lost for wire in connections if wire.lost]

    def close(self) -> None:
        for wire in self._opened:
            wire.close()
