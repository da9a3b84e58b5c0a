"""The check-list of a release, run by a machine: `make release-check`.

Versions agree; wheel and source distribution are built, and their metadata are right; the wheel is installed in an
empty environment of every Python that is found, and each public name can be imported; all packages that this brings are
in the list of licences, and none is under the GPL; the commands of the tutorial, copied out of its page, run in the
newest of these environments to the report; lines that are written for other systems are listed. `--licences` writes the
list of licences from an environment with all extras (2.5 GB).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]
_LIST = _ROOT / "docs" / "licences.md"
_OLDEST = (3, 11)
# what the metadata of a package leave open or abbreviate, read in its licence file
_NAMED = {
    "contourpy": "BSD-3-Clause",
    "cycler": "BSD-3-Clause",
    "jinja2": "BSD-3-Clause",
    "kiwisolver": "BSD-3-Clause",
    "matplotlib": "PSF-based (matplotlib licence)",
    "scipy": "BSD-3-Clause",
}
_TOOLS = {"pip", "setuptools", "femtune"}  # of the environment
_FOUND = """
import json
from importlib.metadata import distributions
rows = []
for d in distributions():
    m = d.metadata
    classes = [c.split("::")[-1].strip() for c in m.get_all("Classifier", []) if c.startswith("License")]
    licence = m.get("License-Expression") or (m.get("License") or "").strip().split("\\n")[0]
    rows.append((d.name, licence if 0 < len(licence) < 80 else ", ".join(classes)))
print(json.dumps(rows))
"""
_VERSION = "import sys; print(*sys.version_info[:2], sys.base_prefix)"
_IMPORTS = "import femtune; [getattr(femtune, name) for name in femtune.__all__]"
_HEADING = """# Licences

All packages that an installation of femtune with all extras brings, direct and transitive ones.
[Dependencies](dependencies.md) says why each direct one was chosen. femtune itself is under the BSD-3-Clause licence.
The packages of Intel belong to the extra `fast` only; they are proprietary and may be redistributed.

| package | licence |
| --- | --- |
| three.js (part of `report.html`) | MIT |
"""


def main() -> int:
    """Run the check-list; 1 if a point of it is not met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--licences", action="store_true", help="write docs/licences.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # its pip serves the other environments: making one of its own would take longer than much that it installs
        tools = _environment(folder / "tools", sys.executable, "build", "twine", *_backend())
        wheel, source = _built(folder, tools)
        if options.licences:
            extras = ",".join(_extras())
            _write_list(_packages(_environment(folder / "all", sys.executable, f"{wheel}[{extras}]", pip=tools)))
            return 0
        problems = _versions() + _contents(source)
        pythons = _pythons()
        for python in pythons:
            inside = _environment(folder / python.name, str(python), str(wheel), pip=tools)
            print(f"{python.name}: installed ({_megabytes(folder / python.name):.0f} MB)")
            problems += _installed(inside)
        problems += _followed(inside, folder / "work")
    print(f"written for other systems than {sys.platform}, and not run here:", *_for_other_systems(), sep="\n  ")
    for problem in problems:
        print(f"NOT MET: {problem}")
    print("release check: " + ("not met" if problems else "all points are met"))
    return 1 if problems else 0


def _backend() -> list[str]:
    """What builds femtune."""
    requires: list[str] = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"][
        "requires"
    ]
    return requires


def _extras() -> list[str]:
    """The extras of a user: those of developers bring other tools."""
    project = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [e for e in project["optional-dependencies"] if e not in {"test", "lint", "notebooks", "docs", "dev"}]


def _versions() -> list[str]:
    """The version is the same wherever it is stated."""
    project = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    stated = {
        "src/femtune/__init__.py": r'__version__ = "(.*)"',
        "CITATION.cff": r"(?m)^version: (.*)$",
        "CHANGELOG.md": r"(?m)^## (\S+)",
    }
    found = {file: re.search(rule, (_ROOT / file).read_text(encoding="utf-8")) for file, rule in stated.items()}
    return [f"{file} does not state version {project}" for file, m in found.items() if not m or m[1] != project]


def _built(folder: Path, tools: Path) -> tuple[Path, Path]:
    """Wheel and source distribution, built from the files that are under version control, and checked by twine.

    The environment of the tools has what builds femtune and nothing that femtune needs, as one that `build` would make.
    """
    checkout = folder / "checkout"
    # the checkout may belong to another user
    _run(["git", "-c", "safe.directory=*", "clone", "--quiet", str(_ROOT), str(checkout)])
    _run([str(tools), "-m", "build", "--no-isolation", "--outdir", str(folder / "dist"), str(checkout)])
    _run([str(tools), "-m", "twine", "check", "--strict", *(str(p) for p in (folder / "dist").iterdir())])
    (wheel,), (source,) = (folder / "dist").glob("*.whl"), (folder / "dist").glob("*.tar.gz")
    for file in (wheel, source):
        print(f"{file.name}: {file.stat().st_size / 1e6:.1f} MB")
    return wheel, source


def _contents(source: Path) -> list[str]:
    listed = subprocess.run(["tar", "-tzf", str(source)], capture_output=True, text=True, check=True).stdout
    return [
        f"{name} is not in {source.name}"
        for name in ("LICENSE", "README.md", "src/femtune/py.typed")
        if name not in listed
    ]


def _pythons() -> list[Path]:
    """One interpreter of each version from 3.11 on: on the path, or of pyenv."""
    found: dict[tuple[int, int], Path] = {}
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    places = [shutil.which(f"python3.{minor}") for minor in range(_OLDEST[1], 20)]
    for place in [sys.executable, *places, *map(str, sorted(root.glob("versions/*/bin/python3")))]:
        if place is None:
            continue
        said = subprocess.run(
            [place, "-c", "import sys; print(*sys.version_info[:2], sys.base_prefix)"],
            capture_output=True,
            text=True,
            check=False,
        )
        if said.returncode == 0:
            major, minor, base = said.stdout.split(maxsplit=2)
            version = (int(major), int(minor))
            if version >= _OLDEST:
                found.setdefault(version, Path(base.strip()) / "bin" / f"python{major}.{minor}")
    return [found[version] for version in sorted(found)]


def _environment(folder: Path, python: str, *packages: str, pip: Path | None = None) -> Path:
    """An environment with packages, installed by the pip of another environment where one is given; its Python."""
    _run([python, "-m", "venv", *(["--without-pip"] if pip else []), str(folder)])
    inside = folder / "bin" / "python"
    command = [str(pip or inside), "-m", "pip", "--python", str(inside)]
    _run([*command, "install", "--quiet", "--disable-pip-version-check", "--no-compile", *packages])
    return inside


def _installed(inside: Path) -> list[str]:
    """Each public name can be imported, and the licence of each package is listed."""
    _run([str(inside), "-c", _IMPORTS])
    listed = _listed()
    problems = []
    for name, licence in _packages(inside):
        if name.lower() not in listed:
            problems.append(f"{name} ({licence}) is not in {_LIST.name}: python .ci/release.py --licences")
        elif re.search(r"(?<!L)GPL", listed[name.lower()]):
            problems.append(f"{name} is under {listed[name.lower()]}")
    return problems


def _followed(inside: Path, work: Path) -> list[str]:
    """The tutorial as written, in an environment that has the wheel only."""
    work.mkdir()
    page = (_ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.S)
    (work / "plate.py").write_text(code, encoding="utf-8")
    blocks = re.findall(r"```\n(femtune.*?)```", page, re.S)
    for command in ["python plate.py", *(command for block in blocks for command in block.splitlines())]:
        program, *arguments = shlex.split(command)
        # the verdict on the run of the page is "not accepted", which ends with 4
        _run([str(inside.parent / program), *arguments], cwd=work, code=4 if arguments[0] == "run" else 0)
    written = (work / "run" / "report.html").exists()
    print(f"tutorial followed with {inside.resolve().name}" + (" to the report" if written else ""))
    return [] if written else ["the tutorial wrote no report"]


def _for_other_systems() -> list[str]:
    """Lines that ask which system femtune runs on, or need what only Linux has: a branch of each is not run here."""
    asked = re.compile(r"sys\.platform|\"/proc|os\.name\b")
    return [
        f"{path.relative_to(_ROOT).as_posix()}:{number}: {line.strip()}"
        for path in sorted((_ROOT / "src").rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if asked.search(line)
    ]


def _megabytes(folder: Path) -> float:
    return sum(p.stat().st_size for p in folder.rglob("*") if p.is_file() and not p.is_symlink()) / 1e6


def _packages(inside: Path) -> list[tuple[str, str]]:
    said = subprocess.run([str(inside), "-c", _FOUND], capture_output=True, text=True, check=True).stdout
    rows = {name: _NAMED.get(name.lower(), licence) for name, licence in json.loads(said)}
    return sorted(((n, licence) for n, licence in rows.items() if n not in _TOOLS), key=lambda row: row[0].lower())


def _listed() -> dict[str, str]:
    rows = re.findall(r"(?m)^\| ([^|]+) \| ([^|]+) \|$", _LIST.read_text(encoding="utf-8"))
    return {name.strip().lower(): licence.strip() for name, licence in rows}


def _write_list(packages: list[tuple[str, str]]) -> None:
    rows = "".join(f"| {name} | {licence} |\n" for name, licence in packages)
    _LIST.write_text(_HEADING + rows, encoding="utf-8")


def _run(command: list[str], cwd: Path | None = None, code: int = 0) -> None:
    # modules are compiled once, also where the environment forbids it: the commands of the tutorial share them
    compiling = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
    done = subprocess.run(command, cwd=cwd, env=compiling, capture_output=True, text=True, check=False)
    if done.returncode != code:
        raise SystemExit(f"{shlex.join(command)}\n{done.stdout[-3000:]}{done.stderr[-3000:]}")


if __name__ == "__main__":
    sys.exit(main())
