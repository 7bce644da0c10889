"""Reads a report as a program: its sections, its plots' data, and whether it is well-formed."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np

_VOID = {"meta", "link", "img", "br", "hr", "input"}


class _Checker(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.outside: list[str] = []
        self.links: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in _VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id" and value:
                self.ids.append(value)
            if name == "href" and tag == "a" and value and not value.startswith("#"):
                self.links.append(value)
            elif name in ("src", "href") and value and not value.startswith(("data:", "#")):
                self.outside.append(value)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in ("script", "style"):
            self.text.append(data)


class Page:
    """A report's text, element ids and packed data. Fails on markup that does not nest and on anything from outside."""

    def __init__(self, html: str) -> None:
        checker = _Checker()
        checker.feed(html)
        assert checker.open == []
        assert checker.outside == []
        assert not re.search(r"url\((?!#)|@import", html)
        self.html, self.ids, self.links = html, checker.ids, checker.links
        assert len(set(self.ids)) == len(self.ids)
        self.text = " ".join(" ".join(checker.text).split())
        found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
        self.data: dict[str, Any] = json.loads(found[1]) if found else {}

    def plot(self, key: str) -> dict[str, Any]:
        return next(p for p in self.data["plots"] if p["key"] == key)

    def series(self, key: str, name: str, flight: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """(seconds, values) of a plot's series."""
        found = (s for s in self.plot(key)["series"] if (s["name"], s["flight"]) == (name, flight))
        series = next(found)
        return self._array(series["t"]), self._array(series["y"])

    def _array(self, index: int) -> np.ndarray:
        return np.frombuffer(base64.b64decode(self.data["arrays"][index]), "<f4")
