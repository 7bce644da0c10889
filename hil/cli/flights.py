"""The engine of `perch-hil run`: checks everything first, then flies seed after seed. It prints nothing."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.assembly.plan import Plan
from hil.check.interlock import Clearance, check_override, clear_to_arm
from hil.check.moment import Moment
from hil.host.flight import Flight, fly
from hil.recording import provenance
from hil.recording.autopilot_parameters import note_parameters
from hil.viewer.view import free_port
from kernel.toml_errors import ConfigError
from scenarios.draw import MAX_SEED, draw
from vehicle.quadrotor.airframe import load_airframe

if TYPE_CHECKING:
    from hil.viewer.foxglove.live import FoxgloveProcess
    from hil.viewer.live import RunViewer
    from hil.viewer.tap import Feed


@dataclass(frozen=True)
class Request:
    """What is to be flown, and where its files go. `remote`, `endpoint` and `keys` are the live host's, `foxglove` the
    port at which a live run is served to Foxglove (None: it is not)."""

    scenario: str
    rig: str | None  # None: the scenario's
    policy: str | None
    camera: str | None
    pictures: str
    out: Path
    records: Path
    override: str | None = None
    live: bool = False
    remote: tuple[str, ...] = ()
    endpoint: str | None = None
    keys: Path | None = None
    view: bool = False
    foxglove: int | None = None


@dataclass(frozen=True)
class Flown:
    """One flight. `timing`: how a live run kept time, None in lockstep; `unseen`: messages that a viewer left out."""

    flight: Flight
    timing: dict[str, Any] | None
    unseen: int = 0


@dataclass(frozen=True)
class Listener:
    """Receives the state of the flights: `progress(seed, now_ns, stage)`, and remarks as lines of text."""

    progress: Callable[[int, int, str], None]
    remark: Callable[[str], None]


def plan_of(request: Request, seeds: Sequence[int]) -> Plan:
    """The checked plan of all seeds.

    Raises ConfigError, ContractError or ValueError for what cannot be flown, or not with these options.
    """
    check_override(request.override)
    plan = Plan(request.scenario, request.rig, request.policy, request.camera, live=request.live)
    if seeds[-1] > MAX_SEED:
        raise ConfigError(f"seed {seeds[-1]} is out of range: use 0 to {MAX_SEED}")
    if not plan.rig.simulated and not request.live:
        raise ConfigError(f'rig "{plan.rig_name}" has real devices, which keep real time: add --live')
    if request.live:
        from hil.live.options import check_options

        check_options(
            plan.rig,
            request.remote,
            request.endpoint,
            request.keys,
            viewed=request.view or request.foxglove is not None,
        )
        if "brain" not in request.remote:
            plan.check_latency(time.perf_counter)
    else:
        given = [f"--{name}" for name in ("remote", "endpoint", "keys") if getattr(request, name)]
        given += [] if request.foxglove is None else ["--foxglove"]
        if given:
            raise ConfigError(f"{', '.join(given)}: only a live run has a bus: add --live")
    return plan


def fly_seeds(request: Request, plan: Plan, seeds: Sequence[int], listener: Listener) -> Iterator[Flown]:
    """Fly one seed after the other, until one is interrupted.

    Raises NotClearedError without a go, ProvenanceError, RunError or RecordingError where the run's folder cannot be
    written, SupervisorError where a live run cannot be started, ViewerError without a viewer.
    """
    code = provenance.code()
    clearance = _clear(request, plan)
    if clearance.remark:
        listener.remark(clearance.remark)
    with _viewer(request, listener) as viewer:
        for seed in seeds:
            plan.check_unchanged()
            if seed != seeds[0]:  # a go grows old, and a file may be changed between two flights
                clearance = _clear(request, plan)
            fly_one = _fly_live if request.live else _fly_lockstep
            flown = fly_one(request, plan, seed, code, clearance, listener, viewer)
            note_parameters(flown.flight.run)
            yield flown
            if flown.flight.interrupted:
                return


def _clear(request: Request, plan: Plan) -> Clearance:
    return clear_to_arm(
        plan.rig_name, plan.rig, plan.policy_name, plan.scenario,
        folder=request.records, now=Moment.now(), override=request.override,
    )  # fmt: skip


def _fly_lockstep(
    request: Request,
    plan: Plan,
    seed: int,
    code: provenance.Code,
    clearance: Clearance,
    listener: Listener,
    viewer: RunViewer | None,
) -> Flown:
    with _feed(plan, seed, viewer) as feed:
        flight = fly(
            plan.scenario, plan.rig, plan.make_policy(), seed,
            policy_name=plan.policy_name, rig_name=Path(plan.rig_name).stem, pictures=request.pictures,
            out=request.out, code=code, clearance=clearance.manifest(),
            progress=lambda now_ns, stage: listener.progress(seed, now_ns, stage), viewer=feed,
        )  # fmt: skip
    return Flown(flight, None, feed.dropped if feed is not None else 0)


def _fly_live(
    request: Request,
    plan: Plan,
    seed: int,
    code: provenance.Code,
    clearance: Clearance,
    listener: Listener,
    viewer: RunViewer | None,
) -> Flown:
    from hil.live.run import fly_live

    names = {field: getattr(request, field) for field in ("scenario", "rig", "policy", "camera")}
    endpoint = request.endpoint
    if endpoint is None and (viewer is not None or request.foxglove is not None):
        # a viewer's process needs it before the hub is started
        endpoint = f"{'tcp' if request.keys is None else 'tls'}/127.0.0.1:{free_port()}"
    with ExitStack() as viewers:
        viewers.enter_context(_feed(plan, seed, viewer, endpoint or "", str(request.keys or "")))
        shown = viewers.enter_context(_foxglove(request, plan, seed, endpoint or "", listener))
        live = fly_live(
            plan, names, seed, pictures=request.pictures, out=request.out, code=code, clearance=clearance.manifest(),
            progress=lambda now_ns, stage: listener.progress(seed, now_ns, stage), remote=request.remote,
            endpoint=endpoint, keys=request.keys, arming=clearance.arming,
        )  # fmt: skip
    return Flown(live.flight, live.summary, shown.dropped if shown is not None else 0)


def _viewer(request: Request, listener: Listener) -> AbstractContextManager[RunViewer | None]:
    if not request.view:
        return nullcontext()
    from hil.viewer.live import RunViewer

    return RunViewer(listener.remark)


def _foxglove(
    request: Request, plan: Plan, seed: int, endpoint: str, listener: Listener
) -> AbstractContextManager[FoxgloveProcess | None]:
    if request.foxglove is None:
        return nullcontext()
    from hil.assembly.sensing import mounted_cameras
    from hil.viewer.foxglove.feed import ServerSpec
    from hil.viewer.foxglove.live import LAYOUT, FoxgloveProcess

    frame = load_airframe(plan.rig.vehicle.airframe)
    camera = mounted_cameras(plan.rig.camera, frame, draw(plan.scenario, seed))[1]
    process = FoxgloveProcess(
        ServerSpec(
            request.foxglove, endpoint, str(request.keys or ""), f"{plan.scenario.name} seed {seed}",
            plan.scenario.board.size, asdict(camera),
        )
    )  # fmt: skip
    listener.remark(f"Foxglove: open ws://127.0.0.1:{process.port}; the layout is {LAYOUT}")
    return process


def _feed(
    plan: Plan, seed: int, viewer: RunViewer | None, endpoint: str = "", keys: str = ""
) -> AbstractContextManager[Feed | None]:
    if viewer is None:
        return nullcontext()
    mount = load_airframe(plan.rig.vehicle.airframe).camera
    return viewer.feed(
        f"{plan.scenario.name} seed {seed}", board_size=plan.scenario.board.size,
        tolerance=plan.scenario.tolerance.distance, camera_offset=mount.offset,
        camera_tilt=math.radians(mount.tilt_deg), endpoint=endpoint, keys=keys,
    )  # fmt: skip
