"""What machines must agree on: every file of the code, Python, Ray, packages."""

import pytest

from hil.campaign.workers.versions import code_digest, code_files, difference
from hil.recording.provenance import CODE, ROOT


@pytest.fixture
def code(tmp_path):
    for package in CODE:
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("")
    return tmp_path


def test_digest_covers_code_and_data_and_not_what_python_leaves(code):
    before = code_digest(code)
    for name in ("hil/__pycache__/x.pyc", "hil/.x.swp", "docs/x.md"):
        (code / name).parent.mkdir(exist_ok=True)
        (code / name).write_text("x")
    assert code_digest(code) == before
    (code / "scenarios" / "mine.toml").write_text("x")
    assert code_digest(code) != before


def test_files_of_the_project_hold_networks_rigs_and_code():
    names = {path.relative_to(ROOT).as_posix() for path in code_files(ROOT)}
    assert {"policies/checkpoints/vision.onnx", "hil/assembly/rigs/sim.toml", "hil/campaign/grid.py"} <= names


@pytest.mark.parametrize(
    ("theirs", "said"),
    [
        ({"Python": "3.11.9", "ray": "2.60.0", "code": "a"}, ""),
        ({"Python": "3.12.1", "ray": "2.60.0", "code": "a"}, "Python 3.12.1 and not 3.11.9"),
        ({"Python": "3.11.9", "code": "b"}, "ray none and not 2.60.0, code b and not a"),
    ],
)
def test_difference_names_what_differs(theirs, said):
    assert difference(theirs, {"Python": "3.11.9", "ray": "2.60.0", "code": "a"}) == said


def test_difference_of_everything_stays_short():
    ours = {f"package-{n}": "1" for n in range(40)}
    assert difference({}, ours).endswith("package-2 none and not 1, 37 more")
