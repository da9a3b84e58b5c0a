"""history.jsonl: a line for every iteration, written as soon as it is known."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from femtune.parameters import ParameterSet
from femtune.study.run_folder import unwritable
from femtune.update import Iteration

HISTORY_FILE = "history.jsonl"


@dataclass(frozen=True)
class History:
    """The file of one run; `begin` removes that of an earlier run."""

    folder: Path
    parameters: ParameterSet

    @property
    def path(self) -> Path:
        """The file."""
        return self.folder / HISTORY_FILE

    def begin(self) -> None:
        """An empty file (error ``run.unwritable``)."""
        try:
            # removed first: a link of this name must not lead the lines into another file
            self.path.unlink(missing_ok=True)
            self.path.touch(exist_ok=False)
        except OSError as error:
            raise unwritable(self.folder, error) from error

    def add(self, iteration: Iteration) -> None:
        """A line for an iteration (error ``run.unwritable``)."""
        line = {
            "iteration": iteration.number,
            "mean_error": iteration.mean_error,
            "objective": iteration.objective,
            "parameters": self.parameters.values(iteration.x),
            "at_bound": iteration.at_bound,
            "events": iteration.events,
        }
        try:
            with self.path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(line, ensure_ascii=False) + "\n")
        except OSError as error:
            raise unwritable(self.folder, error) from error
