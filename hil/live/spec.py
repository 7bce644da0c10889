"""The spec of a live run: one JSON file from which every process builds its nodes."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from hil.assembly.node_table import service_nodes
from hil.assembly.plan import Plan
from hil.assembly.rig import Rig
from hil.bus.leaf import Credentials, credentials_in
from hil.live.wires import Ports
from scenarios.draw import Drawn, draw


class LiveSpec(BaseModel):
    """One live run. `folder` is the run's; `keys` the folder of `perch-hil keys`, empty for an open bus."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scenario: str
    rig: str
    policy: str | None
    camera: Literal["pictures", "model"] | None
    seed: int
    endpoint: str
    ports: Ports
    pictures: str
    folder: Path | None
    keys: Path | None = None

    def plan(self) -> Plan:
        """Scenario, rig and policy, read and checked. Raises ConfigError, ContractError or ValueError."""
        return Plan(self.scenario, self.rig, self.policy, self.camera)

    def draw(self, plan: Plan) -> Drawn:
        """The run's drawn numbers."""
        return draw(plan.scenario, self.seed)

    def services(self, rig: Rig | None = None) -> dict[str, tuple[str, ...]]:
        """service -> its nodes, in the order of starting."""
        return service_nodes(rig or self.plan().rig)

    def credentials(self, service: str) -> Credentials | None:
        """The files that make a process this service; None on an open bus."""
        return None if self.keys is None else credentials_in(self.keys, service)

    def digest(self, plan: Plan) -> str:
        """Digest of what two hosts must agree on: scenario, rig, policy and seed."""
        agreed = [plan.scenario.model_dump_json(), plan.rig.model_dump_json(), plan.policy_name, str(self.seed)]
        return hashlib.sha256("\n".join(agreed).encode()).hexdigest()[:12]

    @classmethod
    def read(cls, path: Path) -> LiveSpec:
        """Raises ValueError for a file that is no spec."""
        try:
            return cls.model_validate_json(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
        except ValidationError as error:
            fault = error.errors()[0]
            where = ".".join(map(str, fault["loc"]))
            raise ValueError(f"{path}: is no spec of a live run: {where}: {fault['msg']}") from None

    def write(self, path: Path) -> None:
        path.write_text(self.model_dump_json(indent=2) + "\n", encoding="utf-8")


def simulated_twin(rig: Rig) -> Rig:
    """The same rig with every device simulated: warming up must not reach a real device."""
    update = {
        "vehicle": rig.vehicle.model_copy(update={"kind": "sim", "url": ""}),
        "groundcar": rig.groundcar.model_copy(update={"kind": "sim"}),
        "camera": rig.camera.model_copy(update={"kind": "sim", "device": ""}),
        "mocap": rig.mocap.model_copy(update={"kind": "sim"}),
    }
    return rig.model_copy(update=update)
