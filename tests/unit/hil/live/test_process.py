"""Processes that are started with SIGINT blocked, and when the interrupt reaches the one that starts them."""

import signal
import subprocess
import sys
import threading

import pytest

from hil.live.process import interrupts_blocked

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
