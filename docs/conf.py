"""How the documentation is built: `make docs`, without network, warnings are errors.

`make docs` describes the names that users need; with the tag `internals` (`make internals`) it describes every module.
"""

from __future__ import annotations

import pkgutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import guide_pictures
import page_pictures
import pictures
from card_table import write_card_table
from error_pages import write_error_pages
from format_tables import write_format_tables
from object_pages import write_object_pages
from sphinx.util import logging

import femtune

project = "femtune"
author = "the femtune developers"
project_copyright = "2026, the femtune developers"
version = release = femtune.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "mathml",
    "plain_docstrings",
    "key_tables",
    "object_pages",
]
_INTERNALS = tags.has("internals")  # noqa: F821 - Sphinx provides the tags
_PUBLIC = ("plot", "testing")  # packages whose functions users call by the name of the package
exclude_patterns = ["_build", "_ext"]
html_theme = "furo"
html_title = f"femtune {release}"
html_static_path = ["_static"]
html_css_files = ["messages.css"]
html_search_scorer = str(Path(__file__).parent / "_static" / "search_order.js")
html_math_renderer = "mathml"
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
napoleon_google_docstring = False
napoleon_use_param = True
napoleon_use_rtype = False
default_role = "code"
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_default_options = {"members": True, "show-inheritance": False}
toc_object_entries = False
# A class is documented where it lives and named again where it is imported from.
suppress_warnings = ["ref.python", "toc.empty_glob"]

_DOCS = Path(__file__).parent
_API = _DOCS / "api"


def _modules() -> dict[str, bool]:
    """Names of the public modules, and whether each is a package."""
    found = {m.name: m.ispkg for m in pkgutil.walk_packages(femtune.__path__, "femtune.")}
    return {name: found[name] for name in sorted(found) if "._" not in name}


def _write_api_pages() -> None:
    """One page an object for users, and one a package, so that a new module is documented without being listed."""
    _API.mkdir(exist_ok=True)
    write_object_pages(_API)
    pages: dict[str, list[str]] = {}
    for name, is_package in _modules().items():
        package = name.split(".")[1]
        if _INTERNALS or package in _PUBLIC:
            pages.setdefault(package, []).append(_section(name, is_package))
    for stale in _API.glob("*.md"):
        if stale.stem not in (*pages, "index"):
            stale.unlink()
    for package, sections in pages.items():
        text = f"# femtune.{package}\n" + "".join(sections)
        page = _API / f"{package}.md"
        if not page.exists() or page.read_text() != text:
            page.write_text(text)


def _section(name: str, is_package: bool) -> str:
    """What a package imports from its modules is described there."""
    heading = f"\n## {name}\n" if name.count(".") > 1 else ""
    members = "   :no-members:\n" if is_package else ""
    return f"{heading}\n```{{eval-rst}}\n.. automodule:: {name}\n{members}```\n"


_write_api_pages()
write_error_pages(
    _DOCS / "errors",
    Path(femtune.__file__).parent / "messages",
    _DOCS.parent / "tests" / "messages" / "shown",
)
write_format_tables(_DOCS)
write_card_table(_DOCS)
if not (pictures.are_current() and page_pictures.are_current() and guide_pictures.are_current()):
    logging.getLogger(__name__).warning("docs/_static/pictures were made by other code: run make pictures")
