"""One live run: starts hub, recorder, services and supervisor, and leaves the same run folder as lockstep."""

from __future__ import annotations

import socket
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from hil.assembly.plan import Plan
from hil.bus.clock import Clock, DateWatch
from hil.bus.leaf import Bus
from hil.bus.session import no_shared_memory
from hil.contract.graph import GraphError
from hil.contract.topics import Knows
from hil.host.flight import Flight
from hil.host.space import check_space
from hil.live.ending import TURN_S, await_drivers, bring_down
from hil.live.graph import check_live_graph
from hil.live.judge import Ended, judge
from hil.live.load import load_now, sleep
from hil.live.orphaned import remove_orphaned_memory
from hil.live.run_clock import clock_lines
from hil.live.run_events import RunEvents
from hil.live.spec import LiveSpec, run_digests
from hil.live.supervisor import Supervisor, SupervisorError
from hil.live.wires import free_ports
from hil.recording.provenance import Code
from hil.recording.runs import SCORE, Run, new_run, policy_identity
from vehicle.px4.driver.arming import Arming

_OVERTIME_S = 150.0  # prepare and margin on top of the scenario's lead and time limit


@dataclass(frozen=True)
class LiveFlight:
    """A flight, and how the processes kept time."""

    flight: Flight
    summary: dict[str, Any]


def fly_live(
    plan: Plan,
    names: dict[str, Any],
    seed: int,
    *,
    pictures: str,
    out: Path,
    code: Code,
    progress: Callable[[int, str], None],
    keys: Path | None = None,
    remote: tuple[str, ...] = (),
    endpoint: str | None = None,
    clearance: Mapping[str, Any] | None = None,
    arming: Arming | None = None,
    watch: Callable[[Supervisor], object] = lambda _: None,
) -> LiveFlight:
    """Fly one seed in real time. `names`: scenario, rig, policy and camera as the user gave them, for the processes.

    Services in `remote` (or the hub) are started elsewhere, and the run waits for them; `keys`, a folder of
    `perch-hil keys`, closes the bus to all other processes; `arming` is what the go is bound to: a real vehicle that is
    not so is not armed; `watch` is called many times a second during the run. An
    interruption (Ctrl-C) brings every device to its safe state, closes the recording and is reported in the result.

    Raises RunError, ProvenanceError or SupervisorError if the run cannot take place or cannot be kept: such a run does
    not take off.
    """
    check_space(out, pictures)
    digests = run_digests(plan, seed)
    run = new_run(
        out,
        scenario={**plan.scenario.model_dump(mode="json"), "name": plan.scenario.name},
        rig={**plan.rig.model_dump(mode="json"), "name": Path(plan.rig_name).stem},
        seed=seed,
        host="live",
        policy=policy_identity(plan.policy_name),
        simulated=plan.rig.simulated,
        started_utc=datetime.now(UTC),
        code=code,
        more={"clearance": dict(clearance or {}), "digests": digests},
    )
    endpoint = endpoint or f"{'tcp' if keys is None else 'tls'}/127.0.0.1:{_free_port()}"
    logs = run.path / "live"
    logs.mkdir()
    spec = LiveSpec(
        **names, seed=seed, endpoint=endpoint, ports=free_ports(plan.rig), pictures=pictures,
        folder=run.path.resolve(), keys=keys,
    )  # fmt: skip
    spec.write(logs / "spec.json")
    wall, state = time.perf_counter(), "failed"
    ended = Ended()
    supervisor = Supervisor(logs / "spec.json", endpoint, logs, remote, digests)
    progress = _without_terminal(progress)
    try:
        with supervisor:
            try:
                _fly(run, supervisor, spec, plan, progress, ended, remote, watch, arming)
            finally:
                supervisor.stop()
                ended.health = supervisor.health
                ended.remarks += supervisor.remarks
                cut = [r for r in supervisor.remarks if r.startswith("recorder ") and not r.endswith("SIGTERM")]
                if cut and not ended.interrupted:
                    ended.trouble = ended.trouble or f"{cut[0]}: the recording lacks its end"
        state = "interrupted" if ended.interrupted else "failed" if ended.trouble or ended.failure else "finished"
    finally:
        leaked = remove_orphaned_memory(supervisor.memory)
        score, table, found = judge(run, plan, seed, ended)
        table["shared_memory_removed"] = len(leaked)
        told = {**score.as_dict(), **({"flight": found.as_dict()} if found else {})}
        files = {"live.json": table, SCORE: told}
        fault = run.finish(state, datetime.now(UTC), files, wall_s=time.perf_counter() - wall)
        ended.trouble = ended.trouble or fault  # a full disk: the result is returned all the same
    counters: dict[str, int] = {}
    for one in ended.health.values():
        for name, count in one.get("counters", {}).items():
            counters[name] = counters.get(name, 0) + count
    flight = Flight(score, run, None, ended.trouble or ended.failure, counters, ended.interrupted, found)
    return LiveFlight(flight, table)


def _fly(
    run: Run,
    supervisor: Supervisor,
    spec: LiveSpec,
    plan: Plan,
    progress: Callable[[int, str], None],
    ended: Ended,
    remote: tuple[str, ...],
    watch: Callable[[Supervisor], object],
    arming: Arming | None,
) -> None:
    """Start, monitor and end the run; the outcome is noted in `ended`."""
    wanted, gone = list(spec.services(plan.rig)), False
    events: RunEvents | None = None
    try:
        try:
            if "hub" not in remote:
                supervisor.start("hub")
            bus = supervisor.connect(spec.credentials("supervisor"))
            events = RunEvents(bus, progress)
            supervisor.start("recorder")
            for service in wanted:
                if service not in remote:
                    supervisor.start(service)
            supervisor.wait_ready(
                ["recorder", *wanted], waiting=lambda missing: progress(0, f"waiting for {', '.join(missing)}")
            )
            _check_graph(supervisor, wanted, plan.rig.policy.knows)
            ended.before = load_now()
            hub_clock, date = _hub_clock(bus), DateWatch()
            started_ns = supervisor.go(ahead_ns=hub_clock.offset_ns, arming=arming)
            gone = True
            with suppress(OSError):  # a flight does not end for its manifest
                since = timedelta(microseconds=(time.monotonic_ns() - started_ns) / 1e3)
                run.begin(datetime.now(UTC) - since)
            for service in remote:
                for line in clock_lines(service, supervisor.health.get(service, {}).get("clock", {})):
                    supervisor.report("info", line)
            remarks = [text for text in (no_shared_memory(),) if text]
            limit = time.monotonic() + plan.scenario.car.lead + plan.scenario.time_limit + _OVERTIME_S
            while events.stage != "ended":
                stalled = sleep(TURN_S)
                if stalled:
                    supervisor.stood_still()
                supervisor.beat()
                events.take()
                watch(supervisor)
                for text in (*remarks, *supervisor.warnings(), *filter(None, [date.text(), stalled])):
                    ended.remarks.append(text)
                    supervisor.report("warning", text)
                remarks.clear()
                ended.trouble = supervisor.trouble()
                if not ended.trouble and time.monotonic() > limit:
                    ended.trouble = f"the run did not end in time (stage {events.stage})"
                if ended.trouble:
                    break
        except KeyboardInterrupt:
            ended.interrupted = True
        except Exception as error:  # a fault of the supervisor itself: vehicle and car are brought down all the same
            if not gone:
                raise
            ended.trouble = f"supervisor failed: {type(error).__name__}: {error}"
            with suppress(OSError):
                (spec.folder or Path()).joinpath("live", "supervisor.log").write_text(traceback.format_exc())
        if ended.trouble or ended.interrupted:
            if events is not None:
                bring_down(supervisor, ended)
        elif not plan.rig.simulated or plan.scenario.fault:
            await_drivers(supervisor)
        if events is not None:
            events.take()
            ended.stage = events.stage
            ended.failure = events.failure(troubled=bool(ended.trouble))
        ended.after = load_now()
    finally:
        if events is not None:
            events.close()


def _without_terminal(progress: Callable[[int, str], None]) -> Callable[[int, str], None]:
    """`progress`, which may print: a terminal that was closed, or a full disk, ends no flight."""

    def called(now_ns: int, stage: str) -> None:
        with suppress(OSError):
            progress(now_ns, stage)

    return called


def _check_graph(supervisor: Supervisor, wanted: list[str], knows: Knows) -> None:
    try:
        check_live_graph(supervisor.health, wanted, knows)
    except GraphError as error:
        raise SupervisorError(str(error)) from None


def _hub_clock(bus: Bus) -> Clock:
    try:
        return bus.clock().measure()
    except TimeoutError as error:
        raise SupervisorError(str(error)) from None


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


__all__ = ["LiveFlight", "SupervisorError", "fly_live"]
