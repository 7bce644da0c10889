"""A rig without its devices: what can be stepped on a machine that has none of them."""

from __future__ import annotations

from hil.assembly.rig import Calibration, Rig


def simulated_twin(rig: Rig) -> Rig:
    """The same rig with every device simulated: what only tries nodes out must not reach a real device."""
    kind = "crazyflie-sim" if rig.vehicle.kind.startswith("crazyflie") else "sim"
    update = {
        "vehicle": rig.vehicle.model_copy(
            update={
                "kind": kind,
                "url": "",
                "simulator": "",
                "px4": "",
                "powered": False,
            }
        ),
        "groundcar": rig.groundcar.model_copy(update={"kind": "sim"}),
        # a lens may see too wide to be drawn: the twin has the ideal camera
        "camera": rig.camera.model_copy(update={"kind": "sim", "device": "", "calibration": Calibration()}),
        "mocap": rig.mocap.model_copy(update={"kind": "sim"}),
    }
    return rig.model_copy(update=update)
