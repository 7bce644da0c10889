"""Entry point of one process of a live run: `python -m hil.live.main SPEC SERVICE`."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time
from pathlib import Path
from types import FrameType

from hil.assembly.builder import Assembly
from hil.assembly.node_table import SERVICES
from hil.bus.clock import DateWatch
from hil.bus.leaf import Bus, BusError
from hil.host.warm_up import warm_up
from hil.live.liveness import Presence
from hil.live.messages.log import log_line
from hil.live.priority import StepPriority, take_priority
from hil.live.process import PARENT, die_with_parent
from hil.live.run_clock import RunTime
from hil.live.service import LiveService
from hil.live.spec import LiveSpec, run_digests
from hil.live.wires import LiveWires
from hil.recording.provenance import ProvenanceError
from hil.recording.receipts import ReceiptBook
from hil.recording.recorder import RecordingError
from hil.wires import WireError

COULD_NOT_RUN = 3
_PATIENCE_S = 40.0  # more than any service takes to reach the safe state


def last_resort(patience_s: float = _PATIENCE_S) -> None:
    """End this process if it hangs for `patience_s` after its parent has ended: no other process would end it."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        time.sleep(patience_s)
        os.kill(os.getpid(), signal.SIGKILL)

    threading.Thread(target=watch, daemon=True).start()


def serve(spec: LiveSpec, service: str, names: tuple[str, ...], *, remote: bool = False, wait_s: float = 10.0) -> int:
    """Drive nodes `names` as `service` until stopped; returns the exit code. `remote`: started by hand, for a run of
    another host, whose hub may take `wait_s` to come up."""
    sys.setswitchinterval(2e-4)  # a thread of the bus must not wait 5 ms for the interpreter
    plan = spec.plan()
    serves, drawn = run_digests(plan, spec.seed), spec.draw(plan)
    warm_up(plan, drawn, names)
    wires = LiveWires(plan.rig, spec.ports)
    assembly = Assembly(
        plan.scenario, plan.rig, drawn, plan.make_policy, wires, time.monotonic_ns, unix_ns=time.time_ns()
    )
    presence = Presence(remote=remote)
    nodes = [assembly.node(name) for name in names]
    if spec.folder is not None:
        wires.start(spec.folder)
    row = SERVICES[service]
    take_priority(row.priority)  # not earlier: building may take long; before the bus, whose thread inherits it
    knows = plan.rig.policy.knows
    with Bus(spec.endpoint, spec.credentials(service), timeout_s=wait_s, identity=service, knows=knows) as bus:
        run_time = RunTime(bus.clock(), DateWatch() if remote else None)
        book = ReceiptBook(spec.folder / f"receipts-{service}.mcap", nodes) if spec.folder else None
        live = LiveService(
            service, nodes, bus, run_time, presence=presence, book=book, trouble=lambda: wires.trouble,
            serves=serves, descriptors=wires.descriptors, phase_ns=row.phase_ns,
            step_priority=StepPriority(row.priority), remarks=wires.remarks,
        )  # fmt: skip

        def stop(_: int, __: FrameType | None) -> None:
            if presence.gone() or presence.orphaned_soon():  # the vehicle is brought to its safe state first
                live.orphaned()
            else:
                live.stop()

        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, stop)
        gc.collect()
        gc.freeze()
        try:
            if live.wait_for_go():
                live.run()
        finally:
            live.close()
            wires.close()
    return COULD_NOT_RUN if live.lost else 0


def main() -> int:
    """Read the spec and serve."""
    if not die_with_parent(int(os.environ.get(PARENT, os.getppid()))):
        sys.exit(COULD_NOT_RUN)
    last_resort()
    service = sys.argv[2]
    try:
        spec = LiveSpec.read(Path(sys.argv[1]))
        if service == "recorder":
            take_priority("recording")
            from hil.live.recorder import record

            return record(spec)
        if service == "hub":
            take_priority("control")
            from hil.live.hub import hub

            return hub(spec)
        return serve(spec, service, spec.services()[service])
    except (BusError, WireError, RecordingError, ProvenanceError, ValueError, OSError) as error:  # the last: no answer
        log_line(f"perch-hil: {service}: {error}")
        return COULD_NOT_RUN


if __name__ == "__main__":
    sys.exit(main())
