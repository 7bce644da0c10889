"""The commands that the pages of the project show."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.paths import ROOT

PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
_HEREDOC = re.compile(r"cat > (\S+) <<'(\w+)'$")


@dataclass(frozen=True)
class Typed:
    """One line of a fenced `sh` block. `body`: what follows of a here-document, for the file that it writes."""

    page: str
    text: str
    body: str = ""

    @property
    def words(self) -> list[str]:
        """As the shell splits it, without a comment and without what follows `>`."""
        found = shlex.split(self.text, comments=True)
        return found[: found.index(">")] if ">" in found else found

    @property
    def writes(self) -> str:
        """The file that `>` writes, or empty."""
        found = shlex.split(self.text, comments=True)
        return found[found.index(">") + 1] if ">" in found else ""

    @property
    def perch(self) -> list[str] | None:
        """The arguments of `perch-hil`, or None if it is another command."""
        words = self.words
        if words[0] == "torchrun" and "hil" in words:
            return words[words.index("hil") + 1 :]
        return words[1:] if Path(words[0]).name == "perch-hil" else None


@cache
def typed(page: Path) -> tuple[Typed, ...]:
    """Every line of the page's `sh` blocks, in order."""
    found = []
    for block in re.findall(r"^```sh\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S):
        lines = iter(block.splitlines())
        for line in lines:
            start = _HEREDOC.match(line)
            if start:
                body = []
                while (inner := next(lines)) != start[2]:
                    body.append(inner)
                found.append(Typed(page.name, f"cat > {start[1]}", "\n".join(body) + "\n"))
            elif line.strip():
                found.append(Typed(page.name, line))
    return tuple(found)


def inline(page: Path) -> list[str]:
    """Every piece of code inside the page's sentences and tables."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    return re.findall(r"`([^`\n]+)`", text)
