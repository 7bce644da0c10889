"""Which workers a campaign gets: this machine's process pool, or a cluster."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from hil.campaign.workers.cluster import connected
from hil.campaign.workers.pool import Pool
from hil.campaign.workers.work import Workers


@contextmanager
def open_workers(cluster: str | None, at_once: int | None) -> Iterator[Workers]:
    """Workers for `at_once` tasks at a time, None for as many as there are cores; `cluster`: its address, or None for
    this machine. Raises ClusterError."""
    if cluster is None:
        yield Pool(at_once or os.cpu_count() or 1)
        return
    with connected(cluster, at_once) as workers:
        yield workers
