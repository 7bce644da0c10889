"""Flights of a campaign, as a worker flies them: scenario, rig and policy as they were checked at the start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hil.assembly.plan import Plan
from hil.assembly.recorded_motion import recorded_file
from hil.assembly.rig import Rig
from hil.campaign.grid import Grid, Job, Result, plan_of, shared_policy
from hil.campaign.workers.work import Place
from hil.host.flight import fly
from hil.recording.autopilot_parameters import note_parameters
from hil.recording.provenance import Code, ProvenanceError
from hil.recording.recorder import RecordingError
from hil.recording.runs import RunError
from hil.scoring.flight_class import UNSAFE
from hil.wires import WireError
from policies.flying.shipped import SHIPPED, policy_file
from scenarios.spec import RecordedPath, Scenario


@dataclass(frozen=True)
class Planned:
    """What is flown, checked. `policy`: a name, or the whole path of a file."""

    scenario: Scenario
    rig: Rig
    rig_name: str
    policy: str

    @classmethod
    def of(cls, plan: Plan) -> Planned:
        file = None if plan.policy_name in SHIPPED else policy_file(plan.policy_name)
        return cls(
            plan.scenario, plan.rig, Path(plan.rig_name).stem, str(file.absolute()) if file else plan.policy_name
        )

    @property
    def files(self) -> dict[str, Path]:
        """Files of the user that a flight reads: as they are called here -> where they are."""
        found = {}
        if self.policy not in SHIPPED and (file := policy_file(self.policy)):
            found[self.policy] = file
        if (airframe := Path(self.rig.vehicle.airframe)).suffix == ".toml":
            found[str(airframe)] = airframe
        if isinstance(self.scenario.path, RecordedPath):
            found[self.scenario.path.file] = recorded_file(self.scenario.path.file)
        if self.rig.camera.kind == "mcap":
            found[self.rig.camera.device] = recorded_file(self.rig.camera.device)
        return found

    def at(self, place: Place) -> Planned:
        """The same with its files where they are at `place`."""
        scenario, rig = self.scenario, self.rig
        if isinstance(scenario.path, RecordedPath):
            path = scenario.path.model_copy(update={"file": place.file(scenario.path.file)})
            scenario = scenario.model_copy(update={"path": path})
        vehicle = rig.vehicle.model_copy(update={"airframe": place.file(rig.vehicle.airframe)})
        camera = rig.camera.model_copy(update={"device": place.file(rig.camera.device)})
        rig = rig.model_copy(update={"vehicle": vehicle, "camera": camera})
        return replace(self, scenario=scenario, rig=rig, policy=place.file(self.policy))


@dataclass(frozen=True)
class Flying:
    """`Work`: flies jobs of one grid. `plans`: (scenario, policy, fault) of a job -> what is flown."""

    out: Path
    plans: Mapping[tuple[str, str, str], Planned]
    pictures: str
    keep: str
    code: Code

    @classmethod
    def of(cls, grid: Grid, jobs: Sequence[Job], code: Code) -> Flying:
        """The work of these jobs of a checked grid."""
        plans = {job.case: Planned.of(plan_of(grid, job)) for job in {job.case: job for job in jobs}.values()}
        return cls(grid.out, plans, grid.pictures, grid.keep, code)

    @property
    def files(self) -> dict[str, Path]:
        """See `Work.files`."""
        return {name: path for plan in self.plans.values() for name, path in plan.files.items()}

    def __call__(self, job: Job, place: Place) -> Result:
        """Fly it; its run is then in the place's folder. Raises KeyboardInterrupt if it was interrupted, with its
        recording closed."""
        plan = self.plans[job.case].at(place)
        try:
            flight = fly(
                plan.scenario, plan.rig, shared_policy(plan.policy, plan.rig)(), job.seed,
                policy_name=plan.policy, rig_name=plan.rig_name, pictures=self.pictures, out=place.out,
                code=self.code, progress=lambda *_: None, clearance={"kind": "simulated"},
            )  # fmt: skip
            if flight.interrupted:
                raise KeyboardInterrupt
            note_parameters(flight.run)
            found = flight.flight_class.name if flight.flight_class else ""
            if self.keep == "unsafe" and found != UNSAFE:
                for path in flight.run.path.glob("*.mcap"):
                    path.unlink()
        except (RunError, RecordingError, ProvenanceError, WireError) as error:
            return Result(job, failure=str(error))
        score = flight.score
        failure = "" if plan.scenario.fault and found else flight.failure
        return Result(job, score.verdict, tuple(score.reasons), failure, found)
