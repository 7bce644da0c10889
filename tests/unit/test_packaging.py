"""What an installed wheel holds: every file that the packages read."""

import re
import tomllib
from pathlib import Path

from tests.paths import ROOT

TABLE = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGES = [pattern.removesuffix("*") for pattern in TABLE["tool"]["setuptools"]["packages"]["find"]["include"]]


def test_every_file_of_a_package_is_in_the_wheel():
    carried = TABLE["tool"]["setuptools"]["package-data"]["*"]
    files = [path for name in PACKAGES for path in (ROOT / name).rglob("*") if path.is_file()]
    left_out = [
        path.relative_to(ROOT)
        for path in files
        if path.suffix not in (".py", ".pyc") and not any(path.match(pattern) for pattern in carried)
    ]
    assert not left_out and len(files) > 400


def test_every_package_that_the_command_imports_is_in_the_wheel():
    tops = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    assert set(PACKAGES) == tops - {"tests", "benchmarks"}


def test_every_hint_to_install_an_extra_names_one_that_the_wheel_has():
    hints = {
        hint
        for name in PACKAGES
        for path in (ROOT / name).rglob("*.py")
        for hint in re.findall(r"pip install [^\n\"]*\[\w+\]", path.read_text(encoding="utf-8"))
    }
    ours = {hint for hint in hints if "python-can" not in hint}
    assert len(ours) >= 6
    for hint in ours:  # a user of the wheel has no folder of the project
        extra = re.fullmatch(r"pip install 'perch-hil\[(\w+)\]", hint)
        assert extra and extra[1] in TABLE["project"]["optional-dependencies"], hint


def test_container_copies_the_files_that_it_names():
    text = Path(ROOT / "Dockerfile").read_text(encoding="utf-8")
    assert "constraints.txt" in text and (ROOT / "constraints.txt").is_file()
    assert 'ENTRYPOINT ["perch-hil"]' in text and "perch-hil" in TABLE["project"]["scripts"]
