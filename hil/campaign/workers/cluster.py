"""Workers of a Ray cluster: each task is a Ray task; answers and runs come back to this machine.

A task whose worker or machine is lost is done again by Ray, and what the first attempt left is never seen here: an
answer and its runs are one object. The code goes with the job, so that the machines need its packages only.
"""

from __future__ import annotations

import logging
import os
import re
import signal
import socket
import sys
import tempfile
import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

from hil.campaign.workers.delivery import Delivery, deliver, unfit
from hil.campaign.workers.shipment import Shipment, copy_code
from hil.campaign.workers.versions import versions
from hil.campaign.workers.work import Answer, ClusterError, Task, Work, WorkersError

AGAIN = 3  # times that a task is done again after its worker was lost
_WAIT_S, _REACH_S = 1.0, 5.0
_ADDRESS = re.compile(r"(ray://)?(\[[0-9a-fA-F:]+\]|[\w.-]+):(\d{1,5})")
_ENVIRONMENT = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}  # Ray reports to no server
_THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


def check_address(address: str) -> None:
    """Raises ClusterError for what is no address of a cluster, or where nothing answers."""
    if address == "auto":
        return
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found[3]) < 65536:
        raise ClusterError(f"--cluster {address}: give ray://HOST:10001, HOST:6379 on one of its machines, or auto")
    try:
        socket.create_connection((found[2].strip("[]"), int(found[3])), _REACH_S).close()
    except OSError as error:
        raise ClusterError(
            f"--cluster {address}: no cluster answers there ({error.strerror or error}): start it with ray start"
        ) from None


def _found() -> str:
    """The address that `auto` stands for: Ray's own variable, or the cluster that was started here last.

    Ray itself waits for minutes where that one has crashed. Raises ClusterError if there is none.
    """
    from ray._private.services import find_bootstrap_address

    address = os.environ.get("RAY_ADDRESS") or find_bootstrap_address(None)
    if not address or address == "auto":
        raise ClusterError("--cluster auto: no cluster was started on this machine: start it with ray start")
    return address


@contextmanager
def connected(address: str, at_once: int | None) -> Iterator[Cluster]:
    """The cluster at `address`, while the connection lasts; `at_once`: tasks on it, None for two a core.

    Raises ClusterError if there is none, or if its versions are not this machine's.
    """
    check_address(address)
    os.environ.update({name: os.environ.get(name, value) for name, value in _ENVIRONMENT.items()})
    try:
        import ray
        from ray.exceptions import RayError
    except ModuleNotFoundError:
        raise ClusterError("--cluster needs ray: pip install 'perch-hil[cluster]' (ray 2.60)") from None
    if address == "auto":
        address = _found()
        check_address(address)
    # what Ray tells of its machines would stand between the results on stdout
    with redirect_stdout(sys.stderr), tempfile.TemporaryDirectory(prefix="perch-hil-code-") as folder:
        code = Path(folder)
        copy_code(code)
        env = {"working_dir": folder, "env_vars": dict.fromkeys(_THREADS, "1")}
        try:
            with warnings.catch_warnings(action="ignore"):
                ray.init(address, runtime_env=env, log_to_driver=False, logging_level=logging.ERROR)
        except (ConnectionError, RuntimeError, ValueError, ImportError, RayError) as error:
            hint = "ray:// has the port 10001 unless ray start was given another, HOST:PORT is as ray start prints it"
            raise ClusterError(f"--cluster {address}: {_line(error)} ({hint})") from None
        try:
            cluster = Cluster(address, at_once, versions(code))
            cluster.check()
            yield cluster
        finally:
            ray.shutdown()  # ends the tasks that are under way


class Cluster:
    """`Workers`: the machines of a Ray cluster that this process is connected to."""

    def __init__(self, address: str, at_once: int | None, ours: dict[str, str]) -> None:
        import ray
        from ray import exceptions

        self._ray: Any = ray
        self._address, self._at_once, self._ours = address, at_once, ours
        self._lost = (
            exceptions.WorkerCrashedError, exceptions.NodeDiedError, exceptions.ObjectLostError,
            exceptions.OutOfMemoryError,
        )  # fmt: skip
        self._broken = (exceptions.RaySystemError, exceptions.RuntimeEnvSetupError, ConnectionError)

    def check(self) -> None:
        """Raises ClusterError if a machine of the cluster has other versions, or there is no core."""
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        if self._cores() < 1:
            raise ClusterError(f"--cluster {self._address}: none of its machines has a core for flights")
        asked = []
        for machine in self._ray.nodes():
            if machine["Alive"] and machine["Resources"].get("CPU", 0) >= 1:
                there = NodeAffinitySchedulingStrategy(machine["NodeID"], soft=False)
                ask = self._ray.remote(num_cpus=0, scheduling_strategy=there)(unfit)
                asked.append(ask.remote(self._ours))
        for answer in asked:
            try:
                self._refuse(self._ray.get(answer))
            except (*self._lost, self._ray.exceptions.TaskUnschedulableError):
                continue  # it has left the cluster
            except self._ray.exceptions.RayError as error:
                raise ClusterError(f"--cluster {self._address}: {_line(error)}") from None

    def each(self, work: Work[Task, Answer], tasks: Sequence[Task]) -> Iterator[Answer]:
        """See `Workers.each`. After an interrupt what is done already is still kept; tasks under way are ended."""
        asked: list[int] = []

        def interrupt(number: int, _: object) -> None:
            asked.append(number)
            if len(asked) > 1:
                raise KeyboardInterrupt

        before = signal.signal(signal.SIGINT, interrupt)
        try:
            yield from self._each(work, tasks, asked)
        except self._broken as error:
            raise WorkersError(
                f"the cluster {self._address} failed: {_line(error)}; the same command goes on from here"
            ) from None
        finally:
            signal.signal(signal.SIGINT, before)

    def _each(self, work: Work[Task, Answer], tasks: Sequence[Task], asked: list[int]) -> Iterator[Answer]:
        ray = self._ray
        remote = ray.remote(num_cpus=1, max_retries=AGAIN)(deliver)
        shipment = ray.put(Shipment.of(work, self._ours))
        waiting, under_way, lost = deque(tasks), [], 0
        while waiting or under_way:
            while waiting and len(under_way) < (self._at_once or 2 * self._cores()):
                under_way.append(remote.remote(shipment, waiting.popleft()))
            done, under_way = ray.wait(under_way, num_returns=1, timeout=_WAIT_S)
            if asked:
                more, under_way = ray.wait(under_way, num_returns=len(under_way), timeout=0) if under_way else ([], [])
                done += more
            elif not done and self._cores() < 1:
                raise WorkersError("the cluster has no machine left; the same command goes on from here")
            for one in done:
                try:
                    delivery: Delivery = ray.get(one)
                except self._lost:
                    lost += 1
                    continue
                self._refuse(delivery.refused)
                delivery.keep(work.out)
                yield delivery.answer
            if asked:
                raise KeyboardInterrupt
        if lost:
            raise WorkersError(
                f"{lost} of {len(tasks)} lost their worker {AGAIN + 1} times each (out of memory?); "
                "the same command goes on from here"
            )

    def _cores(self) -> int:
        return int(self._ray.cluster_resources().get("CPU", 0))

    def _refuse(self, why: str) -> None:
        if why:
            raise ClusterError(f"--cluster {self._address}: {why}: install the same there (constraints.txt)")


def _line(error: BaseException) -> str:
    """What it says, as one line of bounded length."""
    cause = getattr(error, "cause", None)  # of an exception in a task
    return " ".join(str(cause or error).split())[:400] or type(error).__name__
