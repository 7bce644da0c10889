"""Workers of this machine: a pool of processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import numba

from hil.campaign.workers.work import Answer, Place, Task, Work, WorkersError
from hil.live.process import die_with_parent
from kernel.interrupts import interrupts_blocked


class Pool:
    """`Workers`: `processes` of this machine, which write into the work's own folder."""

    def __init__(self, processes: int) -> None:
        self._processes = processes

    def each(self, work: Work[Task, Answer], tasks: Sequence[Task]) -> Iterator[Answer]:
        """See `Workers.each`. An interrupt ends the tasks under way and lets them close their recordings."""
        asked: list[int] = []

        def interrupt(number: int, _: object) -> None:
            asked.append(number)  # an exception out of a signal is lost if it meets a callback or a destructor
            raise KeyboardInterrupt

        context = multiprocessing.get_context("spawn")
        count = min(self._processes, len(tasks))
        pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(os.getpid(), work))
        before = signal.signal(signal.SIGINT, interrupt)
        try:
            with interrupts_blocked():  # `_begin` unblocks it in each process
                waiting: list[Future[tuple[Answer] | None]] = [pool.submit(_do, task) for task in tasks]
            for done in as_completed(waiting):
                answer = done.result()
                if answer is None or asked:
                    raise KeyboardInterrupt
                yield answer[0]
        except BrokenProcessPool:
            raise WorkersError(
                "a flight's process died (out of memory? then use fewer --jobs); the same command goes on from here"
            ) from None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
            signal.signal(signal.SIGINT, before)


_work: Any = None  # of this process, if it is one of a pool


def _begin(campaign: int, work: Any) -> None:
    global _work
    if not die_with_parent(campaign):
        os._exit(1)  # killed already: the result would be read by no process
    numba.set_num_threads(1)  # the processes are the threads
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # but for a task's duration
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    _work = work


def _do(task: Any) -> tuple[Any] | None:
    """In a process of the pool: the answer; None if it was interrupted."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return (_work(task, Place(_work.out)),)
    except KeyboardInterrupt:
        return None
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
