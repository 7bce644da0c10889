"""Ctrl-C at a time when it would be lost: while Numba compiles or loads a kernel, in a destructor, and while processes
are started.

LLVM calls back into Python. An exception that a signal's handler raises in such a callback is printed and lost, or LLVM
ends with an error of its own. So the signal is delivered between two compiler passes, or at the end of the work.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Any

from numba.core import event

_LOCK, _PASS = "numba:compiler_lock", "numba:run_pass"  # Numba's events: around all the work, around one pass of it


class _Handler(event.Listener):
    """SIGINT's handler while the main thread holds the compiler's lock; Python runs handlers in no other thread."""

    def __init__(self) -> None:
        self._depth, self._pending = 0, False
        self._before: Any = None

    def on_start(self, event: event.Event) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        if event.kind == _PASS:
            self._deliver()
            return
        if self._depth == 0:
            self._before = signal.getsignal(signal.SIGINT)
            if callable(self._before):  # not ignored
                signal.signal(signal.SIGINT, self._remember)
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        if threading.current_thread() is not threading.main_thread() or event.kind == _PASS:
            return
        self._depth -= 1
        if self._depth == 0 and signal.getsignal(signal.SIGINT) == self._remember:
            signal.signal(signal.SIGINT, self._before)
            self._deliver()

    def _remember(self, *_: object) -> None:
        self._pending = True

    def _deliver(self) -> None:
        if self._pending:
            self._pending = False
            self._before(signal.SIGINT, None)


def defer_interrupts() -> None:
    """From now on, in this process, while Numba works."""
    handler = _Handler()
    for kind in (_LOCK, _PASS):
        event.register(kind, handler)


@contextmanager
def interrupts_kept() -> Iterator[Callable[[], None]]:
    """Yields what work calls now and then: it raises KeyboardInterrupt if one came within. One that is raised in a
    destructor is printed and lost."""
    handler: Any = signal.getsignal(signal.SIGINT)
    came = False

    def remember(number: int, frame: Any) -> None:
        nonlocal came
        came = True
        handler(number, frame)

    def again() -> None:
        if came:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield again  # nothing comes
        return
    signal.signal(signal.SIGINT, remember)
    try:
        yield again
    finally:
        signal.signal(signal.SIGINT, handler)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """A process that is started within begins with SIGINT blocked, so that none can end it before it has a handler.

    A SIGINT that comes meanwhile reaches this process afterwards.
    """
    resource_tracker.ensure_running()  # its start would unblock SIGINT
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: came.append(number))  # other threads do not block it
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
        if came:
            signal.raise_signal(signal.SIGINT)
