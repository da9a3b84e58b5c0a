"""The report: a document (data), its sections and pictures, and two renderers, HTML and terminal."""

from femtune.report.build import build_report
from femtune.report.html import html_text, write_html
from femtune.report.terminal import print_terminal

__all__ = ["build_report", "html_text", "print_terminal", "write_html"]
