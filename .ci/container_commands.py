"""Commands of the documentation for containers, run as they stand: python .ci/container_commands.py [--evidence DIR].

The commands are taken from the page on the installation. An ordinary user runs them; where this script is started by
root, it makes one. If the image of Python cannot be loaded, an image of that name is made of the Python of this Debian
(apt-get install podman runc uidmap debootstrap). Docker and Apptainer are run where they are; Apptainer may be in the
root file system of another system (--apptainer-root, with /proc, /dev and /sys). Each run must have the exit code and
the numbers of a run without a container, and its folder must belong to the user.

CONTAINERS_CONF, STORAGE_DRIVER and DOCKER_HOST are passed on: a machine may need another runtime, storage or network.
"""

from __future__ import annotations

import argparse
import os
import pwd
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "benchmarks" / "stories")]

import project  # noqa: E402
from project import KINDS, Variant, numbers, write_inputs  # noqa: E402

_PAGE = ROOT / "docs" / "install.md"
_PASSED_ON = ("CONTAINERS_CONF", "STORAGE_DRIVER", "DOCKER_HOST", "LANG")
_USER = "femtune-check"
_BASE = "docker.io/library/python:3.12-slim"
_STAND_IN = """FROM localhost/debian
RUN python3 -m venv /opt/python
COPY pip.conf /etc/pip.conf
COPY authorities /etc/ssl/certs/ca-certificates.crt
ENV PATH=/opt/python/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
"""
_WITH_SOLVER = """FROM femtune
USER root
RUN ln -sf "$(command -v python)" /usr/local/bin/solver-python
USER engineer
"""
_SOLVER = "/usr/local/bin/solver-python"
"""The program of the study with an external solver, as it is named in the image."""
_EQUAL = 1e-9
"""Largest relative difference of the numbers: NumPy and SciPy of the image may be other builds."""
_LONGEST_S = 1500.0
Row = tuple[str, str, str]


@dataclass
class Check:
    """What the checks have in common.

    Parameters
    ----------
    folder : of the user, in which all is written
    user : who runs the commands; "" for who runs this script
    apptainer_root : root file system that has Apptainer; None for that of this system
    expected, codes : numbers and exit codes by study, of runs without a container
    rows : commands, programs, result
    """

    folder: Path
    user: str
    apptainer_root: Path | None
    expected: dict[str, object] = field(default_factory=dict)
    codes: dict[str, int] = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)

    def shell(self, line: str, cwd: Path, *, chroot: bool = False, code: int = 0) -> str:
        """The output of a line of a shell, run by the user; SystemExit if it ends with another exit code."""
        home = self.folder if chroot else self.home
        told = " ".join(f"{k}={shlex.quote(v)}" for k, v in self._environment(home).items())
        line = f"cd {shlex.quote(str(cwd))} && {line}"
        words = ["env", "-i", *shlex.split(told), "sh", "-c", line]
        if chroot and self.apptainer_root is not None:
            one = pwd.getpwnam(self.user) if self.user else pwd.getpwuid(os.getuid())
            # not chroot, in which no user namespace can be made
            change = f"cd {shlex.quote(str(self.apptainer_root))} && pivot_root . mnt && umount -l /mnt && exec "
            change += f"setpriv --reuid={one.pw_uid} --regid={one.pw_gid} --clear-groups {shlex.join(words)}"
            words = ["unshare", "--mount", "--propagation=private", "sh", "-c", change]
        elif self.user:
            words = ["runuser", "-u", self.user, "--", *words]
        done = subprocess.run(words, capture_output=True, text=True, timeout=_LONGEST_S, check=False)
        if done.returncode != code:
            raise SystemExit(f"{line}: {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-3000:]}")
        return done.stdout

    def succeeds(self, line: str) -> bool:
        """Whether a line of a shell, run by the user, ends with 0."""
        return self.shell(f"if {line} >/dev/null 2>&1; then echo yes; fi", self.folder).strip() == "yes"

    @staticmethod
    def _environment(home: Path) -> Mapping[str, str]:
        passed = {name: os.environ[name] for name in _PASSED_ON if name in os.environ}
        path = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
        return {"HOME": str(home), "PATH": path, "OMP_NUM_THREADS": "1", **passed}

    @property
    def home(self) -> Path:
        """Folder in which podman keeps the images of the user."""
        return Path(pwd.getpwnam(self.user).pw_dir) if self.user else self.folder

    def own(self) -> None:
        """Give all files to the user."""
        if self.user:
            subprocess.run(["chown", "-R", f"{self.user}:", str(self.folder)], check=True)

    def add(self, what: str, by: str, result: str) -> None:
        self.rows.append((what, by, result))
        print(what, by, result, sep=" | ", flush=True)

    def run(self, what: str, by: str, command: str, study: str, *, chroot: bool = False) -> None:
        """A command of the page in the folder of a study; its numbers and its owner."""
        work = self.folder / f"{study}-{len(self.rows)}"
        _write(work, study, _SOLVER if study == "solver" else "")
        self.own()
        self.shell(command, work, chroot=chroot, code=self.codes[study])
        owner, user = (work / "run" / "results.json").owner(), self.user or pwd.getpwuid(os.getuid()).pw_name
        if owner != user:
            self.add(what, by, f"failed: the run folder belongs to {owner}")
            return
        largest = _difference(self.expected[study], numbers(work / "run"))
        good = "numbers of a run without a container" if largest <= _EQUAL else "failed: other numbers"
        self.add(what, by, f"{good} (largest relative difference {largest:.0e})")


def main() -> int:
    """Run all; 1 if one fails."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--evidence", type=Path, help="folder of the page")
    parser.add_argument("--debian", type=Path, help="root file system with Python, made by debootstrap before")
    parser.add_argument("--keep", action="store_true", help="keep the images of podman, for the next run")
    parser.add_argument(
        "--apptainer-root", type=Path, help="root file system of a system that has Apptainer; a mount point"
    )
    options = parser.parse_args()
    user = "" if os.getuid() else _USER
    if user and not _is_user(user):
        subprocess.run(["useradd", "--create-home", user], check=True)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        folder.chmod(0o755)
        check = Check(folder / "home", user, options.apptainer_root)
        check.folder.mkdir()
        for study in ("deck", "solver"):
            work = folder / f"quiet-{study}"
            _write(work, study, "")
            check.codes[study] = _quiet(work)
            check.expected[study] = numbers(work / "run")
        try:
            _all(check, options.debian)
        finally:
            if shutil.which("podman") and not options.keep:
                check.shell("podman system reset --force >/dev/null 2>&1 || true", check.folder)
    if options.evidence:
        (options.evidence / "container_commands.md").write_text(_page(check.rows), encoding="utf-8")
    return int(any(row[2].startswith("failed") for row in check.rows))


def _all(check: Check, debian: Path | None) -> None:
    if not shutil.which("podman"):
        check.add("podman, docker, apptainer", "", "not run: podman is not installed")
        return
    podman = check.shell("podman --version", check.folder).strip().replace(" version", "")
    base = _image_of_python(check, debian)
    source = check.folder / "source"
    source.mkdir()
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout.decode()
    for name in filter(None, files.split("\0")):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, source / name)
    check.own()
    build, run = _block("podman build").splitlines()
    check.shell(build, source)
    size = int(check.shell("podman image inspect --format '{{.Size}}' femtune", source)) / 2**20
    check.add("`podman build`", f"{podman}, {base}", f"image of {size:.0f} MiB")
    check.run("`podman run`", podman, run, "deck")
    (check.folder / "with-solver").mkdir()
    (check.folder / "with-solver" / "Containerfile").write_text(_WITH_SOLVER)
    check.own()
    check.shell("podman build -t with-solver .", check.folder / "with-solver")
    check.run("`podman run`, external solver, image `FROM femtune`", podman, _changed(run, "with-solver"), "solver")
    archive = "femtune.tar"
    save, make, start = _block("apptainer build").splitlines()
    check.shell(save, check.folder)
    _docker(check, check.folder / archive)
    if check.apptainer_root is None and not shutil.which("apptainer"):
        check.add("`apptainer build`, `apptainer run`", "", "not run: Apptainer is not installed")
        return
    with_root = _seen_by_apptainer(check)
    try:
        by = check.shell("apptainer --version", check.folder, chroot=True).strip().replace(" version", "")
        check.shell(make, check.folder, chroot=True)
        check.run(
            "`apptainer build`, `apptainer run`", by, start.replace("femtune.sif", "../femtune.sif"), "deck",
            chroot=True,
        )  # fmt: skip
    finally:
        if with_root:
            subprocess.run(["umount", str(with_root)], check=True)


def _seen_by_apptainer(check: Check) -> Path | None:
    """Show the folder, and the user, in the root file system that has Apptainer; what is to be unmounted."""
    if check.apptainer_root is None:
        return None
    place = check.apptainer_root / check.folder.relative_to("/")
    place.mkdir(parents=True, exist_ok=True)
    subprocess.run(["mount", "--bind", str(check.folder), str(place)], check=True)
    for name in ("passwd", "group"):
        lines = [line for line in Path("/etc", name).read_text().splitlines() if line.startswith(f"{check.user}:")]
        known = check.apptainer_root / "etc" / name
        known.write_text("\n".join([*known.read_text().splitlines(), *lines, ""]))
    return place


def _docker(check: Check, archive: Path) -> None:
    if not shutil.which("docker") or subprocess.run(["docker", "info"], capture_output=True, check=False).returncode:
        check.add("`docker run`", "", "not run: there is no Docker daemon")
        return
    subprocess.run(["docker", "load", "--input", str(archive)], check=True, capture_output=True)
    subprocess.run(["docker", "tag", "localhost/femtune", "femtune"], check=True)
    version = subprocess.run(
        ["docker", "version", "--format", "{{.Server.Version}}"], capture_output=True, text=True, check=True
    ).stdout.strip()
    if check.user:
        subprocess.run(["usermod", "-aG", "docker", check.user], check=True)
    check.run("`docker run`", f"docker {version}", _block("docker run"), "deck")


def _image_of_python(check: Check, debian: Path | None) -> str:
    """The image that the Containerfile begins with; what it is, in words."""
    if check.succeeds(f"podman image exists {_BASE} && podman image exists localhost/debian"):
        # of a run with --keep
        return _stand_in(check)
    if check.succeeds(f"podman pull {_BASE}"):
        return f"image `{_BASE}`"
    made = check.folder / "python"
    made.mkdir()
    (made / "Containerfile").write_text(_STAND_IN)
    (made / "pip.conf").write_text("[global]\ncert = /etc/ssl/certs/ca-certificates.crt\n")
    shutil.copyfile("/etc/ssl/certs/ca-certificates.crt", made / "authorities")
    system = debian or made / "system"
    if debian is None:
        release = re.search(r"VERSION_CODENAME=(\w+)", Path("/etc/os-release").read_text())
        assert release is not None
        words = ["debootstrap", "--variant=minbase", "--include=python3,python3-venv,ca-certificates", release[1]]
        subprocess.run([*words, str(system)], check=True, capture_output=True)
    packed = check.folder / "system.tar"
    subprocess.run(["tar", "-C", str(system), "--exclude=./dev/*", "-cf", str(packed), "."], check=True)
    if debian is None:
        shutil.rmtree(system)
    check.own()
    check.shell(f"podman import {packed} localhost/debian", made)
    packed.unlink()
    check.shell(f"podman build -t {_BASE} .", made)
    return _stand_in(check)


def _stand_in(check: Check) -> str:
    version = check.shell(f"podman run --rm {_BASE} python --version", check.folder).strip()
    return f"image of Debian with {version} in place of `{_BASE}`"


def _is_user(name: str) -> bool:
    try:
        pwd.getpwnam(name)
    except KeyError:
        return False
    return True


def _block(word: str) -> str:
    """The only block of the page that has a word, without its last line end."""
    blocks = re.findall(r"```\w*\n(.*?)\n```", _PAGE.read_text(encoding="utf-8"), re.S)
    (block,) = (one for one in blocks if word in one)
    return str(block)


def _changed(run: str, image: str) -> str:
    return run.replace(" femtune run ", f" {image} run ")


def _write(folder: Path, study: str, program: str) -> None:
    """Write a study: a deck, or a chain whose solver is a program that the image has."""
    folder.mkdir()
    kind = KINDS[2] if study == "deck" else KINDS[0]
    own = project._PYTHON
    files = write_inputs(folder, kind, Variant(), "run")
    text = files[f"{kind.name}.toml"].decode()
    (folder / "study.toml").write_text(text.replace(own, program) if program else text)
    (folder / f"{kind.name}.toml").unlink()


def _quiet(folder: Path) -> int:
    """Run a study without a container; its exit code, which tells the verdict."""
    words = [sys.executable, "-m", "femtune", "run", "study.toml", "--quiet"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=_LONGEST_S, check=False)
    if done.returncode not in (0, 3, 4):
        raise SystemExit(f"a run without a container: {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.returncode


def _difference(a: object, b: object) -> float:
    """The largest relative difference of the numbers of two trees; infinite where they differ in anything else."""
    if isinstance(a, dict) and isinstance(b, dict) and a.keys() == b.keys():
        return max((_difference(a[key], b[key]) for key in a), default=0.0)
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return max((_difference(x, y) for x, y in zip(a, b)), default=0.0)
    if isinstance(a, float) and isinstance(b, float):
        return abs(a - b) / max(abs(a), abs(b), 1e-300) if a != b else 0.0
    return 0.0 if a == b else float("inf")


def _page(rows: list[Row]) -> str:
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return f"""# Commands for containers

Commands of [Installation](../install.md), run on {datetime.now(UTC):%Y-%m-%d} as the page has them, by an ordinary user
on one machine. One study is a deck with three starts; the other has an external solver, which is in the image. The
numbers are parameters with their intervals, modes and residuals; exit codes must be equal, and the run folder must
belong to the user. Made by `.ci/container_commands.py` (`make container-check`).

| commands | programs | result |
| --- | --- | --- |
{table}
"""


if __name__ == "__main__":
    sys.exit(main())
