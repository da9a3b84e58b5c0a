"""Commands of the pages for clusters, run as they stand: python .ci/cluster_commands.py [--evidence docs/evidence].

Slurm with one node is started in a folder of its own where it is installed (apt-get install slurmd slurmctld
slurm-client). The job script, the commands and the Python lines are taken from the pages; names of machines, ports,
cores and the number of tasks are replaced by those of this machine. Each run must have the numbers of a run without a
cluster. `dask` and dask-jobqueue must be importable: `make cluster-check` installs them.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "benchmarks" / "stories")]

from project import KINDS, Variant, numbers, write_inputs  # noqa: E402

_PAGE = ROOT / "docs" / "guide" / "slurm.md"
_PROGRAMS = ("slurmctld", "slurmd", "sbatch", "srun")
_CONF = """ClusterName=check
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
AuthType=auth/{auth}
CredType=cred/{auth}
{authinfo}
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
MpiDefault=none
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs=4 RealMemory=4000 State=UNKNOWN
PartitionName=normal Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""
_LONGEST_S = 1500.0
"""Time in s after which a command is given up; on a busy machine Python takes a minute to begin."""
Row = tuple[str, str, str]


def main() -> int:
    """Run all; 1 if one fails."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--evidence", type=Path, help="folder of the page")
    parser.add_argument("--only", default="", help="checks whose name contains a word")
    options = parser.parse_args()
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        quiet = _study(folder / "quiet", "")
        _run(["femtune", "update", "study.toml", "--quiet"], quiet)
        expected = numbers(quiet / "run")
        with _slurm(folder / "slurm") as by:
            for check in (_job_script, _jobqueue):
                if options.only in check.__name__:
                    rows.append(check(folder, expected, by))
                    print(*rows[-1], sep=" | ", flush=True)
    if options.evidence:
        (options.evidence / "cluster_commands.md").write_text(_page(rows), encoding="utf-8")
    return int(any(row[2].startswith("failed") for row in rows))


# ----------------------------------------------------------------------------------------------------
# Slurm of one node.


@contextmanager
def _slurm(folder: Path) -> Iterator[str]:
    """Slurm under way, with its version; "" where it is not installed."""
    if not all(map(shutil.which, _PROGRAMS)):
        yield ""
        return
    for part in ("state", "spool"):
        (folder / part).mkdir(parents=True)
    host = socket.gethostname().partition(".")[0]
    started, auth, info = [], "none", ""
    if not list(Path("/usr/lib").glob("*/slurm-wlm/auth_none.so")):
        auth, info = "munge", f"AuthInfo=socket={folder}/munge"
        (folder / "key").write_bytes(os.urandom(256))
        (folder / "key").chmod(0o400)
        folder.chmod(0o755)
        words = ["munged", "--foreground", "--force", f"--key-file={folder}/key", f"--socket={folder}/munge"]
        words += [f"--log-file={folder}/munged.log", f"--pid-file={folder}/munged.pid", f"--seed-file={folder}/seed"]
        started.append(subprocess.Popen(words))
        time.sleep(2.0)
    text = _CONF.format(host=host, auth=auth, authinfo=info, ports=_free_ports(2), folder=folder)
    (folder / "slurm.conf").write_text(text)
    os.environ["SLURM_CONF"] = str(folder / "slurm.conf")
    for words in (["slurmctld", "-D"], ["slurmd", "-D", "-N", host]):
        # their logs are in the folder
        started.append(subprocess.Popen(words, stderr=subprocess.DEVNULL))
    try:
        end = time.monotonic() + 120.0
        while "idle" not in (said := _output(["sinfo", "--noheader", "--format=%T"])):
            if time.monotonic() > end:
                logs = "".join(p.read_text(errors="replace")[-1500:] for p in folder.glob("*.log"))
                raise SystemExit(f"Slurm did not begin: {said}\n{logs}")
            time.sleep(1.0)
        yield _output(["sinfo", "--version"]).strip()
    finally:
        subprocess.run(["scancel", "--user=root"], check=False, capture_output=True)
        time.sleep(1.0)
        for process in reversed(started):
            process.terminate()
            process.wait()


def _free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [int(one.getsockname()[1]) for one in sockets]
    for one in sockets:
        one.close()
    return ports


# ----------------------------------------------------------------------------------------------------
# What the pages have.


def _blocks(page: Path) -> list[str]:
    return re.findall(r"```\w*\n(.*?)```", page.read_text(encoding="utf-8"), re.S)


def _block(word: str) -> str:
    """The only block of the page on Slurm that has a word."""
    (block,) = (one for one in _blocks(_PAGE) if word in one)
    return str(block)


def _here(text: str, ports: Sequence[int]) -> str:
    """Lines of the page for this machine: its name, free ports, two tasks of one core."""
    for old, new in (
        ("login1", "127.0.0.1"), ("8786", str(ports[0])), ("8787", str(ports[1])), ("--ntasks=8", "--ntasks=2"),
        ("--cpus-per-task=4", "--cpus-per-task=1"), ("jobs=8", "jobs=2"), ("job_cpu=4", "job_cpu=1"),
        ('memory="8GB"', 'memory="1GB"'),
    ):  # fmt: skip
        text = text.replace(old, new)
    return text


def _study(folder: Path, parallel: str) -> Path:
    """A chain of two masses whose solver is a program of its own."""
    folder.mkdir()
    files = write_inputs(folder, KINDS[0], Variant(), "run")
    (folder / "study.toml").write_bytes(files[f"{KINDS[0].name}.toml"] + parallel.encode())
    return folder


def _job_script(folder: Path, expected: object, by: str) -> Row:
    """`dask scheduler`, `sbatch workers.sh`, `femtune`."""
    what = "job script with `srun dask worker`"
    if not by:
        return what, "", "not run: Slurm is not installed"
    ports = _free_ports(2)
    work = _study(folder / "job", _here(_block("[parallel]"), ports))
    (work / "workers.sh").write_text(_here(_block("#SBATCH"), ports))
    scheduler, submit, femtune = _here(_block("dask scheduler"), ports).splitlines()
    words, here = scheduler.rstrip("& ").split(), _environment()
    with subprocess.Popen(words, cwd=work, env=here, stderr=subprocess.DEVNULL) as running:
        try:
            _run(submit.split(), work)
            _run([*femtune.replace(" run ", " update ").split(), "--quiet"], work)
        finally:
            subprocess.run(["scancel", "--user=root"], check=False)
            running.terminate()
    return what, by, _compared(expected, work)


def _jobqueue(folder: Path, expected: object, by: str) -> Row:
    """The Python lines with `SLURMCluster`."""
    what = "`SLURMCluster` of dask-jobqueue"
    if not by:
        return what, "", "not run: Slurm is not installed"
    work = _study(folder / "queue", "")
    lines = _here(_block("SLURMCluster"), _free_ports(2))
    before, call, after = lines.partition("ft.run(")
    told = "with open('study.toml', 'a') as out:\n    print(f'[parallel]\\nhow = \"cluster\"\\n"
    told += 'address = "{cluster.scheduler_address}"\\nremote = true\', file=out)\n'
    # jobs of dask-jobqueue end with the object that made them
    (work / "lines.py").write_text(f"{before}{told}{call.replace('run', 'update')}{after}cluster.close()\n")
    _run([sys.executable, "lines.py"], work)
    import dask_jobqueue  # noqa: PLC0415

    return what, f"{by}, dask-jobqueue {dask_jobqueue.__version__}", _compared(expected, work)


def _compared(expected: object, work: Path) -> str:
    return "numbers of a run without a cluster" if numbers(work / "run") == expected else "failed: other numbers"


# ----------------------------------------------------------------------------------------------------


def _environment() -> dict[str, str]:
    """That of this process, with its Python first in the path."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}


def _run(command: Sequence[str], cwd: Path) -> None:
    done = subprocess.run(
        command, cwd=cwd, env=_environment(), capture_output=True, text=True, timeout=_LONGEST_S, check=False
    )
    if done.returncode:
        said = "".join(p.read_text(errors="replace")[-2000:] for p in cwd.glob("slurm-*.out"))
        raise SystemExit(f"{' '.join(command)}: {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}{said}")


def _output(command: Sequence[str], cwd: Path | None = None) -> str:
    done = subprocess.run(
        command, cwd=cwd, env=_environment(), capture_output=True, text=True, timeout=_LONGEST_S, check=False
    )
    return done.stdout


def _page(rows: list[Row]) -> str:
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return f"""# Commands for clusters

Commands of [Runs on a Slurm cluster](../guide/slurm.md), run on {datetime.now(UTC):%Y-%m-%d} as the page has them, with
the names, ports and cores of this machine and two tasks of one core. Slurm has one node: the machine itself. The study
has an external solver. Made by `.ci/cluster_commands.py` (`make cluster-check`).

| commands | programs | result |
| --- | --- | --- |
{table}

SLEPc on two ranks is among the tests. The commands for containers have [a page of their own](container_commands.md).
Not run: Slurm with several machines, and other queues (PBS, LSF).
"""


if __name__ == "__main__":
    sys.exit(main())
