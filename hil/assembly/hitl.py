"""The wires of a vehicle of kind hitl: the simulator link and, where it is started here, the firmware itself."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from pathlib import Path

from hil.assembly.rig import VehicleSlot
from hil.wires import WireError
from hil.wires.firmware import Firmware
from hil.wires.settled import IdleCore, SettledServer
from hil.wires.simulator import PORT, SimulatorPort, SimulatorServer, check_simulator
from vehicle.px4.event_texts import EventTexts, load_events
from vehicle.px4.hitl.parameters import firmware_parameters
from vehicle.quadrotor.airframe import load_airframe

BUILD = "PERCH_HIL_PX4"
"""Environment variable: PX4's build folder where the rig names none."""
OFFBOARD_PORT = 14540
_FIRMWARE_PORT = 14580  # the other end of the offboard link: taken by a firmware without our simulator as well
_LARGEST = 9  # PX4 shares ports between instances above


def build_folder(slot: VehicleSlot) -> str:
    """PX4's build folder, of the rig or the environment; empty if the user starts the firmware."""
    return slot.px4 or os.environ.get(BUILD, "")


def firmware_events(slot: VehicleSlot) -> EventTexts | None:
    """What the EVENTs of the firmware in the build folder say; None without a folder or a description in it."""
    if slot.kind != "hitl" or not build_folder(slot):
        return None
    try:
        return load_events(Path(build_folder(slot)).expanduser() / "etc/extras/all_events.json.xz")
    except (OSError, ValueError):
        return None


def idle_core(slot: VehicleSlot) -> IdleCore | None:
    """The core of a deterministic firmware, None for others. Raises WireError where it cannot be had."""
    if not slot.deterministic:
        return None
    if not build_folder(slot):
        raise WireError(
            f"deterministic = true: name PX4's build folder by px4 or {BUILD}; only a firmware that the run starts can "
            "have a core of its own"
        )
    return IdleCore()


def free_instance(slot: VehicleSlot) -> int:
    """The number of the firmware that this run starts: the first whose ports are free. 0 if it starts none.

    Raises WireError if all are in use.
    """
    if slot.kind != "hitl" or slot.on_hardware or not build_folder(slot):
        return 0
    for instance in range(_LARGEST + 1):
        ports = ((socket.SOCK_STREAM, PORT), (socket.SOCK_DGRAM, OFFBOARD_PORT), (socket.SOCK_DGRAM, _FIRMWARE_PORT))
        if all(_free(kind, first + instance) for kind, first in ports):
            return instance
    raise WireError(
        f"no firmware can be started: for each i of 0 to {_LARGEST} one of the ports TCP {PORT} + i, "
        f"UDP {OFFBOARD_PORT} + i and UDP {_FIRMWARE_PORT} + i is in use; end other firmwares"
    )


class HitlWires:
    """Opened by the host of the device's node: `simulator` at once, the firmware with `start`."""

    def __init__(self, slot: VehicleSlot, instance: int = 0, core: IdleCore | None = None) -> None:
        """`core`: that of a deterministic firmware.

        Raises WireError for a port in use, a device that is missing, a build folder without PX4.
        """
        kind, where, number = check_simulator(slot.simulator)
        self.simulator: SimulatorServer | SimulatorPort
        self._firmware: Firmware | None = None
        if kind == "serial":
            self.simulator = SimulatorPort(where, number)
            return
        build = build_folder(slot)
        if build:
            parameters = firmware_parameters(load_airframe(slot.airframe), slot.external_pose)
            self._firmware = Firmware(build, parameters, instance, None if core is None else core.core)
        address = where, number + instance
        if core is not None and self._firmware is not None:
            self.simulator = SettledServer(*address, core, self._firmware.starting)
        else:
            self.simulator = SimulatorServer(*address)

    def start(self, folder: Path) -> None:
        """Start the firmware, its log into `folder`, and wait until one has joined. Raises WireError."""
        if isinstance(self.simulator, SimulatorServer):
            if self._firmware is not None:
                self._firmware.start(folder)
                self.simulator.relaunch = self._relaunch
            self._accept(self.simulator)

    def _relaunch(self) -> None:
        assert self._firmware is not None and isinstance(self.simulator, SimulatorServer)
        self._firmware.restart()
        self._accept(self.simulator)

    def _accept(self, server: SimulatorServer) -> None:
        server.accept(ended=lambda: self._firmware.ended() if self._firmware is not None else "")

    @property
    def lost(self) -> str:
        """Why a serial port is gone; empty while it is there."""
        return self.simulator.lost if isinstance(self.simulator, SimulatorPort) else ""

    def close(self) -> None:
        """Close the link and end the firmware; may be called twice."""
        self.simulator.close()
        if self._firmware is not None:
            self._firmware.stop()


def offboard_url(slot: VehicleSlot, instance: int) -> str:
    """The offboard link's address: the rig's, or that of the firmware which this run starts."""
    return slot.url or f"udp://:{OFFBOARD_PORT + instance}"


def _free(kind: socket.SocketKind, port: int) -> bool:
    with socket.socket(socket.AF_INET, kind) as one, suppress(OSError):
        if kind == socket.SOCK_STREAM:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        one.bind(("0.0.0.0", port))
        return True
    return False
