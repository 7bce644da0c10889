"""Ctrl-C while a kernel is compiled, in a destructor, or while processes are started: it is delivered, and the work can
be done again."""

import signal
import subprocess
import sys
import threading

import pytest
from numba.core import event

from kernel.interrupts import interrupts_blocked, interrupts_kept
from kernel.jit import njit
from tests.paths import ROOT


class SendInterrupt(event.Listener):
    """Sends SIGINT at the first start of an event."""

    def __init__(self):
        self.sent = False

    def on_start(self, event):
        if not self.sent:
            self.sent = True
            signal.raise_signal(signal.SIGINT)

    def on_end(self, event):
        pass


def fresh(scale):
    """A kernel that nothing has compiled."""

    @njit(cache=False)
    def kernel(x):
        return scale * x

    return kernel


IN_CALLBACK = """
import signal
from numba.core import codegen
from kernel.jit import njit

hook = codegen.JITCodeLibrary._object_compiled_hook

def interrupted(cls, engine, buffer):
    print("in callback")
    signal.raise_signal(signal.SIGINT)
    return hook(engine, buffer)

codegen.JITCodeLibrary._object_compiled_hook = classmethod(interrupted)  # before LLVM's engine takes it

@njit(cache=False)
def kernel(x):
    return 2.0 * x

try:
    kernel(1.0)
except KeyboardInterrupt:
    print("delivered")
"""


def test_interrupt_within_a_callback_of_llvm_is_delivered():
    finished = subprocess.run(
        [sys.executable, "-c", IN_CALLBACK], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert set(finished.stdout.splitlines()) == {"in callback", "delivered"} and not finished.stderr


@pytest.mark.parametrize("kind", ["numba:compiler_lock", "numba:compile", "numba:run_pass", "numba:llvm_lock"])
def test_interrupt_during_any_part_is_delivered_and_the_handler_is_restored(kind):
    before = signal.getsignal(signal.SIGINT)
    kernel = fresh(3.0)
    with pytest.raises(KeyboardInterrupt), event.install_listener(kind, SendInterrupt()):
        kernel(1.0)
    assert signal.getsignal(signal.SIGINT) is before
    assert kernel(1.0) == 3.0


def test_a_handler_that_returns_is_called_once_and_the_kernel_is_compiled():
    asked = []
    before = signal.signal(signal.SIGINT, lambda *_: asked.append(1))
    try:
        with event.install_listener("numba:compile", SendInterrupt()):
            assert fresh(4.0)(1.0) == 4.0
    finally:
        signal.signal(signal.SIGINT, before)
    assert asked == [1]


def test_an_ignored_interrupt_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with event.install_listener("numba:compile", SendInterrupt()):
            assert fresh(5.0)(1.0) == 5.0
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


IS_BLOCKED = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))"


def is_blocked():
    return (
        subprocess.run([sys.executable, "-c", IS_BLOCKED], capture_output=True, text=True, check=True).stdout
        == "True\n"
    )


def test_a_process_started_within_begins_with_it_blocked_and_one_started_afterwards_does_not():
    with interrupts_blocked():
        assert is_blocked()
    assert not is_blocked()


@pytest.mark.parametrize("taken_by", ["this thread", "another"])
def test_an_interrupt_meanwhile_comes_afterwards(taken_by):
    def take():
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        if taken_by == "another":
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})

    reached = []
    with pytest.raises(KeyboardInterrupt), interrupts_blocked():
        if taken_by == "another":
            thread = threading.Thread(target=take)
            thread.start()
            thread.join()
        else:
            take()
        reached.append("the end")
    assert reached == ["the end"]


class InterruptedDestructor:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_interrupt_that_is_lost_in_a_destructor_is_raised_at_the_next_call():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), interrupts_kept() as interrupted:
        interrupted()
        one = InterruptedDestructor()
        del one
        interrupted()
        pytest.fail("the interrupt was lost")
    assert signal.getsignal(signal.SIGINT) is before


def test_interrupt_is_raised_at_once_where_nothing_loses_it():
    with pytest.raises(KeyboardInterrupt), interrupts_kept():
        signal.raise_signal(signal.SIGINT)
        pytest.fail("the interrupt came late")


def test_ignored_interrupt_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interrupts_kept() as interrupted:
            signal.raise_signal(signal.SIGINT)
            interrupted()
    finally:
        signal.signal(signal.SIGINT, before)
