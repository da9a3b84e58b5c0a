"""The report: a document (data), its sections and pictures, and two renderers, HTML and terminal."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.reporting.build import build_page, build_report
    from femtune.reporting.html import check_page, html_text, write_html
    from femtune.reporting.identification import build_identification_page
    from femtune.reporting.terminal import print_terminal
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "build_identification_page",
    "build_page",
    "build_report",
    "check_page",
    "html_text",
    "print_terminal",
    "write_html",
]
