"""Keys and lines typed before a question do not answer it."""

import array
import fcntl
import os
import pty
import select
import signal
import termios
import threading
from collections.abc import Iterator

import pytest

from hil.check.keyboard import Keyboard


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    """(the typist's end, the program's end)"""
    typist, program = pty.openpty()
    yield typist, program
    for end in (typist, program):
        os.close(end)


def queued(fd: int) -> int:
    """Bytes that can be read now."""
    count = array.array("i", [0])
    fcntl.ioctl(fd, termios.FIONREAD, count)
    return count[0]


def typed(typist: int, program: int, text: str) -> None:
    """Type, and wait until it has arrived."""
    os.write(typist, text.encode())
    assert select.select([program], [], [], 10)[0]


def test_line_typed_before_the_question_is_discarded(terminal, capsys):
    typist, program = terminal
    answers: list[str] = []
    with os.fdopen(os.dup(program), "r") as stream:
        typed(typist, program, "as always\n")
        reader = threading.Thread(target=lambda: answers.append(Keyboard(stream).line("why? ")), daemon=True)
        reader.start()
        while queued(program) and reader.is_alive():  # until it was thrown away, or taken for the answer
            pass
        os.write(typist, b"  a loose screw \n")
        reader.join(30)
    assert answers == ["a loose screw"]


def test_key_typed_before_the_question_is_discarded(terminal):
    typist, program = terminal
    with os.fdopen(os.dup(program), "r") as stream:
        typed(typist, program, "p\n")
        # the prompt is shown when what was typed ahead is gone: what is pressed from then on counts
        assert Keyboard(stream).key("pf", lambda: typed(typist, program, "f")) == "f"
        lines = termios.tcgetattr(program)[3] & termios.ICANON
    assert lines  # the terminal is as it was


@pytest.mark.parametrize("pressed", ["\x1b[A", "ppp", "x"])
def test_arrow_keys_and_pasted_text_are_ignored(terminal, pressed):
    typist, program = terminal
    shown: list[bool] = []

    def prompt() -> None:
        typed(typist, program, pressed)
        shown.append(True)

    with os.fdopen(os.dup(program), "r") as stream:
        reader_done: list[str] = []
        reader = threading.Thread(target=lambda: reader_done.append(Keyboard(stream).key("pf", prompt)), daemon=True)
        reader.start()
        while not shown or queued(program):
            pass
        os.write(typist, b"f")
        reader.join(30)
    assert reader_done == ["f"]


@pytest.mark.parametrize("asked", ["key", "line"])
def test_ctrl_c_that_does_not_interrupt_the_blocking_call_still_ends_the_question(terminal, asked):
    """As a Ctrl-C just before the call. Here another thread takes the signal, so that no call is interrupted."""
    typist, program = terminal
    stop, waited_on = threading.Event(), threading.Event()

    def take() -> None:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        if stop.wait(0.5):
            return
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        if not stop.wait(10):
            waited_on.set()
            os.write(typist, b"p\n")  # so that it ends

    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    taker = threading.Thread(target=take)
    taker.start()
    try:
        with os.fdopen(os.dup(program), "r") as stream, pytest.raises(KeyboardInterrupt):
            keyboard = Keyboard(stream)
            print(keyboard.key("p", lambda: None) if asked == "key" else keyboard.line("why? "))
    finally:
        stop.set()
        taker.join()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, handler)
    assert not waited_on.is_set()
