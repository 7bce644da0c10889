"""Room for a run's folder."""

from types import SimpleNamespace

import pytest

from hil.host import space
from hil.recording.runs import RunError


@pytest.mark.parametrize(("pictures", "enough_mb"), [("none", 200), ("preview", 400), ("all", 800), ("raw", 1600)])
def test_run_is_refused_when_free_disk_space_is_too_small(tmp_path, monkeypatch, pictures, enough_mb):
    free = {"free": enough_mb * 10**6}
    monkeypatch.setattr(space.shutil, "disk_usage", lambda _: SimpleNamespace(**free))
    space.check_space(tmp_path / "not" / "made", pictures)
    free["free"] -= 1_000_000
    with pytest.raises(RunError, match=rf"{tmp_path}: {enough_mb - 1} MB are free and a run needs {enough_mb} MB"):
        space.check_space(tmp_path / "not" / "made", pictures)
