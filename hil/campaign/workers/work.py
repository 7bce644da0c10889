"""The one interface of whatever carries out a campaign's tasks: this machine's process pool, and a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, TypeVar

Task = TypeVar("Task")
Answer = TypeVar("Answer")
_Task = TypeVar("_Task", contravariant=True)
_Answer = TypeVar("_Answer", covariant=True)


class WorkersError(RuntimeError):
    """The workers cannot go on; what they did is kept."""


class ClusterError(ValueError):
    """A cluster that is not there or does not fit: nothing was begun on it."""


@dataclass(frozen=True)
class Place:
    """Where a worker does its work. `out`: the folder of its runs; `files`: a file's name here -> its path there."""

    out: Path
    files: Mapping[str, str] = field(default_factory=dict)

    def file(self, name: str) -> str:
        """The path of the file that is called `name` where the campaign was started."""
        return self.files.get(name, name)


class Work(Protocol[_Task, _Answer]):
    """What is done for each task; it can be pickled, and so can tasks and answers.

    `out`: the folder that its runs go to at last; `files`: what it reads besides the project's own files, by name.
    """

    @property
    def out(self) -> Path: ...

    @property
    def files(self) -> Mapping[str, Path]: ...

    def __call__(self, task: _Task, place: Place, /) -> _Answer:
        """Raises KeyboardInterrupt if it was interrupted."""
        ...


class Workers(Protocol):
    """Processes that do work."""

    def each(self, work: Work[Task, Answer], tasks: Sequence[Task]) -> Iterator[Answer]:
        """The answer to every task as it comes, in any order; its runs are then in the work's folder. For the main
        thread.

        Ctrl-C ends it with KeyboardInterrupt. Raises WorkersError if workers are lost, ClusterError if one does not
        fit; what was answered is kept.
        """
        ...
