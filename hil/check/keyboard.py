"""Reads keys and lines from a terminal. Input typed before a question is discarded, so that it confirms nothing."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from collections.abc import Callable
from typing import IO

_SIGNALS_EVERY_S = 0.2


class Keyboard:
    """The terminal on standard input."""

    def __init__(self, stream: IO[str] | None = None) -> None:
        self._stream = stream or sys.stdin

    @property
    def present(self) -> bool:
        """True if input comes from a terminal."""
        try:
            return self._stream.isatty()
        except ValueError:  # closed
            return False

    def key(self, allowed: str, prompt: Callable[[], None]) -> str:
        """One of `allowed` (lower case), without Enter. KeyboardInterrupt is Ctrl-C, EOFError a lost terminal.

        `prompt` is shown after input typed ahead was discarded: only later keys count.
        """
        fd = self._stream.fileno()
        before = termios.tcgetattr(fd)
        try:
            tty.setcbreak(fd, termios.TCSAFLUSH)  # discards what was typed; Ctrl-C still interrupts
            prompt()
            while True:
                _wait_for_input(fd)
                data = os.read(fd, 64)
                if not data or data == b"\x04":
                    raise EOFError("the terminal is gone")
                pressed = data.decode("utf-8", "replace").lower()
                if len(pressed) == 1 and pressed in allowed:  # arrow keys and pasted text are several
                    return pressed
        except OSError as error:
            raise EOFError(f"the terminal is gone: {error.strerror}") from None
        finally:
            self._restore(fd, before)

    def line(self, prompt: str) -> str:
        """A line, without blanks at its ends."""
        fd = self._stream.fileno()
        termios.tcflush(fd, termios.TCIFLUSH)
        print(prompt, end="", flush=True)
        _wait_for_input(fd)
        text = self._stream.readline()
        if not text:
            raise EOFError("the terminal is gone")
        return text.strip()

    @staticmethod
    def _restore(fd: int, before: list) -> None:
        try:
            termios.tcsetattr(fd, termios.TCSADRAIN, before)
        except termios.error:
            return  # the terminal is gone, and its settings with it


def _wait_for_input(fd: int) -> None:
    """Wait in steps: a Ctrl-C just before a call that blocks is seen only when that call ends."""
    while not select.select([fd], [], [], _SIGNALS_EVERY_S)[0]:
        continue
