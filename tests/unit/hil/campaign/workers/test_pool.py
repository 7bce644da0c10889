"""The process pool: one answer to every task, a killed process and an interrupted task end it."""

import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numba
import pytest

from hil.campaign.workers import pool
from hil.campaign.workers.pool import Pool
from hil.campaign.workers.work import Place, WorkersError
from tests.paths import ROOT


@dataclass(frozen=True)
class Doing:
    """`Work` that does what `how` says."""

    how: str
    out: Path
    files = {}  # noqa: RUF012

    def __call__(self, task, place):
        if self.how == "dies":
            os._exit(9)
        if self.how == "is interrupted":
            raise KeyboardInterrupt
        return task * task, place.out, numba.get_num_threads()


def test_every_task_has_one_answer_from_the_works_own_folder_computed_on_one_thread(tmp_path):
    answers = list(Pool(2).each(Doing("squares", tmp_path), range(5)))
    assert sorted(answers) == [(n * n, tmp_path, 1) for n in range(5)]


def test_a_process_that_dies_ends_it_with_one_line(tmp_path):
    with pytest.raises(WorkersError, match="the same command goes on"):
        list(Pool(1).each(Doing("dies", tmp_path), [0]))


def test_an_interrupted_task_ends_it(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        list(Pool(1).each(Doing("is interrupted", tmp_path), range(3)))


EARLY = """
import os, signal, sys, threading
from pathlib import Path
from hil.campaign.workers.pool import Pool
from tests.unit.hil.campaign.workers.test_pool import Doing

if __name__ == "__main__":
    # as a terminal does: to all processes
    threading.Timer(float(sys.argv[1]), lambda: os.killpg(0, signal.SIGINT)).start()
    try:
        list(Pool(2).each(Doing("squares", Path()), range(5)))
    except KeyboardInterrupt:
        print("interrupted")
"""


@pytest.mark.parametrize("delay_s", ["0.01", "0.05", "0.3"])
def test_interrupt_while_the_processes_start_and_import_ends_it_without_a_traceback(tmp_path, delay_s):
    script = tmp_path / "early.py"
    script.write_text(EARLY)
    finished = subprocess.run(
        [sys.executable, script, delay_s], env={**os.environ, "PYTHONPATH": str(ROOT)}, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
    )  # fmt: skip
    assert (finished.returncode, finished.stdout) == (0, "interrupted\n")


@pytest.mark.parametrize(("raised", "expected"), [(None, (7,)), (KeyboardInterrupt(), None)])
def test_a_process_of_the_pool_is_interrupted_during_a_task_only(tmp_path, monkeypatch, raised, expected):
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def work(task, place):
        seen.append(signal.getsignal(signal.SIGINT))
        assert place == Place(tmp_path)
        if raised:
            raise raised
        return task

    work.out = tmp_path
    monkeypatch.setattr(pool, "_work", work)
    try:
        assert pool._do(7) == expected
        assert seen == [signal.default_int_handler] and signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
