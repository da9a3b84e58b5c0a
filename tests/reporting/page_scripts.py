"""The scripts of a page: those of the package, its data, and no other."""

from __future__ import annotations

import json
import re
from importlib.resources import files

_DATA = re.compile(r'<script type="application/json" id="view">([^<]*)</script>')


def bundle(name: str) -> str:
    """A script of the package."""
    return files("femtune.reporting").joinpath(f"bundle/{name}.js").read_text("utf-8")


def without_own_scripts(text: str) -> str:
    """The page without the scripts of the package and its data, which must be JSON without markup."""
    for name in ("page", "viewer", "live"):
        text = text.replace(f"<script>{bundle(name)}</script>", "", 1)
    for data in _DATA.findall(text):
        assert not set(data) & set("<>&")
        json.loads(data)
    return _DATA.sub("", text, count=1)
