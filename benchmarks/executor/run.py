"""Bootstrap runs one after another and in two worker processes: OMP_NUM_THREADS=1 python run.py [RUNS].

Prints the times and their ratio, the start of the processes included, and checks that all numbers are the same.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))  # where structures/ lies

from femtune.executor import Executor, Processes, Serial
from femtune.uncertainty import Bootstrap, BootstrapRun
from structures.cross_frame import Campaigns


def timed(executor: Executor, work: Bootstrap, runs: int) -> tuple[float, list[BootstrapRun]]:
    """Seconds, and the runs."""
    begun = time.perf_counter()
    found = executor.run(work, range(runs))
    return time.perf_counter() - begun, found


def main() -> None:
    """Run the benchmark."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    work = Campaigns().bootstrap(0)
    work(0)
    serial, one = timed(Serial(), work, runs)
    processes, other = timed(Processes(2), work, runs)
    assert [r.x.tobytes() for r in one] == [r.x.tobytes() for r in other]
    print(f"{runs} bootstrap runs of the plane frame, {work.groups} lines, the same numbers to the last bit")
    print(f"one after another: {serial:.2f} s")
    print(f"two processes:     {processes:.2f} s, {serial / processes:.2f} times as fast")


if __name__ == "__main__":
    main()
