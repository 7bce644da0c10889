"""The spec of a live run: one JSON file from which every process builds its nodes."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from hil.assembly.node_table import service_nodes
from hil.assembly.plan import Plan
from hil.assembly.rig import Rig
from hil.bus.leaf import Credentials, credentials_in
from hil.live.wires import Ports
from hil.recording.provenance import code_digests, content_sha256
from policies.flying.registry import POLICY, PREDICTOR
from scenarios.draw import Drawn, draw


class LiveSpec(BaseModel):
    """One live run. `folder` is the run's; `keys` the folder of `perch-hil keys`, empty for an open bus."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scenario: str
    rig: str | None  # None: the scenario's
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
        return Plan(self.scenario, self.rig, self.policy, self.camera, live=True)

    def draw(self, plan: Plan) -> Drawn:
        """The run's drawn numbers."""
        return draw(plan.scenario, self.seed)

    def services(self, rig: Rig | None = None) -> dict[str, tuple[str, ...]]:
        """service -> its nodes, in the order of starting."""
        return service_nodes(rig or self.plan().rig)

    def credentials(self, service: str) -> Credentials | None:
        """The files that make a process this service; None on an open bus."""
        return None if self.keys is None else credentials_in(self.keys, service)

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


def run_digests(plan: Plan, seed: int) -> dict[str, str]:
    """What the processes of a run must agree on, by name: sha256 of scenario, rig, airframe, code and of what the
    policy read from files (a name stands for a policy that has none), and the seed. Raises ProvenanceError."""
    tables = {"scenario": plan.scenario, "rig": plan.rig, "airframe": plan.airframe}
    digests = {name: hashlib.sha256(table.model_dump_json().encode()).hexdigest() for name, table in tables.items()}
    read = plan.make_policy.digests
    policy = {} if POLICY in read else {"policy": plan.policy_name}
    return {**digests, **policy, **read, "seed": str(seed), "code": content_sha256(code_digests())}


def disagreement(service: str, theirs: Mapping[str, str], ours: Mapping[str, str], *, remote: bool) -> str:
    """Why a process that was built for `theirs` cannot serve a run of `ours` (both of `run_digests`), in one line;
    empty if it can. `remote`: it was started on another host."""
    names = [name for name in ours if theirs.get(name) != ours[name]]
    if not names:
        return ""
    if not remote:
        return f"{service} has read another {' and '.join(names)} than this run: changed meanwhile; start again"
    asked = [name for name in names if name not in (POLICY, PREDICTOR, "code")]
    if asked:
        return (
            f"{service} was started for another run (another {', '.join(asked)}): give `perch-hil bus node` the same "
            "scenario, rig, camera, policy and seed"
        )
    name = names[0]
    there, here = (re.sub(r"\W", "", str(table.get(name, "none")))[:12] for table in (theirs, ours))
    copy = "copy this run's file there" + (" and name it by --policy" if name == POLICY else "")
    mend = "install the same version there" if name == "code" else copy
    return f"{service} has another {name} on its host ({there}) than this run ({here}): {mend}"
