"""The parameter service: table of contents, read, write, write by name, default values."""

from __future__ import annotations

import struct
from collections.abc import Callable

from vehicle.crazyflie.crtp import Errno, Packet, ParameterCommand, Parameters, Port
from vehicle.crazyflie.table import PARAMETER_KINDS, Contents, Variable, packed

# Those of the firmware that matter to a client here, with its defaults.
DEFAULTS: dict[Variable, float] = {
    Variable("commander", "enHighLevel", "uint8"): 1,
    Variable("flightmode", "althold", "uint8"): 0,
    Variable("flightmode", "poshold", "uint8"): 0,
    Variable("flightmode", "posSet", "uint8"): 0,
    Variable("flightmode", "yawMode", "uint8"): 2,
    Variable("flightmode", "stabModeRoll", "uint8"): 1,
    Variable("flightmode", "stabModePitch", "uint8"): 1,
    Variable("flightmode", "stabModeYaw", "uint8"): 0,
    Variable("hlCommander", "vtoff", "float"): 0.5,
    Variable("hlCommander", "vland", "float"): 0.5,
    Variable("kalman", "resetEstimation", "uint8"): 0,
    Variable("kalman", "initialYaw", "float"): 0.0,
    Variable("locSrv", "extPosStdDev", "float"): 0.01,
    Variable("locSrv", "extQuatStdDev", "float"): 4.5e-3,
    Variable("pm", "lowVoltage", "float"): 3.2,
    Variable("pm", "criticalLowVoltage", "float"): 3.0,
    Variable("stabilizer", "estimator", "uint8"): 2,
    Variable("stabilizer", "controller", "uint8"): 1,
    Variable("stabilizer", "stop", "uint8"): 0,
    Variable("supervisor", "infdmp", "uint8"): 0,
    Variable("supervisor", "prefltTimeout", "uint16"): 30000,
    Variable("supervisor", "landedTimeout", "uint16"): 3000,
    Variable("supervisor", "tmblChckEn", "uint8"): 1,
    Variable("cpu", "flash", "uint16", True): 1024,
    Variable("firmware", "revision0", "uint32", True): 0x2A18FC29,
    Variable("firmware", "revision1", "uint16", True): 0,
    Variable("firmware", "modified", "uint8", True): 0,
}


class ParameterService:
    """`changed` is called with the full name of a parameter that a client has written."""

    def __init__(self, changed: Callable[[str], None]) -> None:
        self.contents = Contents(DEFAULTS, PARAMETER_KINDS)
        self.values = {variable.full: float(value) for variable, value in DEFAULTS.items()}
        self._defaults = dict(self.values)
        self._changed = changed

    def handle(self, packet: Packet) -> Packet | None:
        """The answer to a request on the parameters' port."""
        answer = None
        if packet.channel == Parameters.TABLE:
            answer = self.contents.answer(packet.data)
        elif packet.channel == Parameters.READ:
            answer = self._read(packet.data)
        elif packet.channel == Parameters.WRITE:
            answer = self._write(packet.data)
        elif packet.channel == Parameters.OTHER:
            answer = self._other(packet.data)
        return None if answer is None else Packet(Port.PARAMETERS, packet.channel, answer)

    def _find(self, number: bytes) -> tuple[Variable, str] | None:
        at = int.from_bytes(number, "little")
        if len(number) < 2 or at >= len(self.contents.variables):
            return None
        variable = self.contents.variables[at]
        return variable, PARAMETER_KINDS[variable.kind][1]

    def _read(self, data: bytes) -> bytes | None:
        if len(data) < 2:
            return None
        found = self._find(data[:2])
        if found is None:
            return data[:2] + bytes((Errno.NO_ENTRY,))
        return data[:2] + b"\0" + packed(self.values[found[0].full], found[1])

    def _write(self, data: bytes) -> bytes | None:
        if len(data) < 2:
            return None
        found = self._find(data[:2])
        if found is None:
            return data[:2] + bytes((Errno.NO_ENTRY,))
        variable, form = found
        if variable.read_only or len(data) < 2 + struct.calcsize(form):
            return None
        self._set(variable, data[2 : 2 + struct.calcsize(form)], form)
        return data

    def _set(self, variable: Variable, value: bytes, form: str) -> None:
        (self.values[variable.full],) = struct.unpack(form, value)
        self._changed(variable.full)

    def _other(self, data: bytes) -> bytes | None:
        command = data[0] if data else -1
        if command == ParameterCommand.SET_BY_NAME:
            return data[:-1] + bytes((self._set_by_name(data[1:]),)) if data.count(0) >= 2 else None
        found = self._find(data[1:3])
        if command == ParameterCommand.GET_DEFAULT:
            if found is None:
                return data[:3] + bytes((Errno.NO_ENTRY,))
            return data[:3] + b"\0" + packed(self._defaults[found[0].full], found[1])
        if command == ParameterCommand.GET_EXTENDED_TYPE:
            return data[:3] + bytes((Errno.NO_ENTRY,))  # none of them is stored in the Crazyflie
        return None

    def _set_by_name(self, data: bytes) -> int:
        group, _, rest = data.partition(b"\0")
        name, _, rest = rest.partition(b"\0")
        number = self.contents.numbers.get(f"{group.decode('latin-1')}.{name.decode('latin-1')}")
        if number is None:
            return Errno.NO_ENTRY
        variable = self.contents.variables[number]
        kind, form = PARAMETER_KINDS[variable.kind]
        if not rest or rest[0] != kind or len(rest) < 1 + struct.calcsize(form):
            return Errno.INVALID
        if variable.read_only:
            return Errno.READ_ONLY
        self._set(variable, rest[1 : 1 + struct.calcsize(form)], form)
        return 0
