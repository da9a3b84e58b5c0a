"""Where the numbers come from."""

from __future__ import annotations

from femtune.report.document import Block, Table, columns, row, table_or_none
from femtune.report.numbers import short
from femtune.report.source import Source


def provenance(source: Source) -> list[Block]:
    """Versions, files with their check sums, durations."""
    origin = source.results.provenance
    facts = {
        "Command": origin.command,
        "Started": origin.started_at,
        "femtune": origin.femtune_version,
        "Python, numpy, scipy": f"{origin.python_version}, {origin.numpy_version}, {origin.scipy_version}",
        "Eigen-solver": origin.eigen_solver,
        "Schema of the results": source.results.schema_version,
    }
    files = [row(f.path, f.sha256) for f in (origin.study_file, *origin.input_files)]
    times = [row(d.step, short(d.duration_s)) for d in origin.durations]
    return [
        Table("Run", columns("What", "Value"), tuple(row(k, v) for k, v in facts.items())),
        Table("Files read", columns("File", "SHA-256"), tuple(files)),
        table_or_none("Time", columns("Step", ">s"), times, "Durations were not recorded."),
    ]
