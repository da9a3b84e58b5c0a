"""The report: a document (data), its sections and pictures, and two renderers, HTML and terminal."""

from femtune.report.build import build_modes_page, build_report, build_responses_page
from femtune.report.html import check_page, html_text, write_html
from femtune.report.identification import build_identification_page
from femtune.report.terminal import print_terminal

__all__ = [
    "build_identification_page",
    "build_modes_page",
    "build_report",
    "build_responses_page",
    "check_page",
    "html_text",
    "print_terminal",
    "write_html",
]
