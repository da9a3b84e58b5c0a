"""No run loses an input, and a run folder belongs to one study."""

from __future__ import annotations

import json
import os
import shutil
import tomllib
import typing
from hashlib import sha256
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from pydantic import BaseModel
from tests.messages.shown import check_shown

import femtune as ft
from femtune.cli import main
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.identification_file import IdentifyFile
from femtune.files.study_file import StudyFile, frozen, read_study_file
from femtune.files.study_file.kinds import NamesFile
from femtune.files.study_file.named_files import FileKey, files_named
from femtune.files.study_file.reading import study_from_text
from femtune.journal.owner import owner_of
from femtune.journal.run_files import OWNER_FILE, RUN_FILES, UPDATES, made_by
from femtune.steps.held_folder import held
from femtune.steps.step import FILE
from femtune.study.inputs import check_outputs, named_inputs
from femtune.study.provenance import inputs_of
from femtune.study.study import read_study
from femtune.testing import example_deck, example_test

HEAD = '[study]\ntitle = "{title}"\ndeck = "d.bdf"\nunits = "m-kg-s"\n'
REST = '[test]\nfile = "t.uff"\n[[parameter]]\nname = "root"\nfields = ["PBAR 1 I1"]\nlower = 0.5\nupper = 2.0\n'
REST += "[residuals]\nfrequency_sd = 0.01\n"

ALL_KEYS = """
[study]
title = "all"
deck = "{0}"
choices = "{27}"
units = "m-kg-s"
[model]
grid = "{1}"
dofs = "{2}"
listing = "{3}"
[[matrix]]
name = "K"
kind = "stiffness"
file = "{4}"
[runs]
file = "{5}"
[solver]
command = ["{6}"]
templates = ["{7}"]
files = ["{8}"]
result = "r.txt"
format = "table"
[test]
file = ["{9}"]
deviations = "{10}"
[[configuration]]
name = "one"
test = "{11}"
deviations = "{12}"
masses_file = "{13}"
runs = "{14}"
[configuration.solver]
command = ["{15}"]
deck = "{16}"
templates = ["{17}"]
files = ["{18}"]
[[parameter]]
name = "p"
prior = "{19}"
[[vibration]]
name = "v"
kind = "transient"
outputs = ["1X+"]
signal = "{20}"
measured = "{21}"
[vibration.solver]
command = ["{22}"]
deck = "{23}"
templates = ["{24}"]
files = ["{25}"]
[quantify]
repeats = ["{26}"]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    example_deck().rename("d.bdf")
    example_test().rename("t.uff")
    return tmp_path


def study(folder: Path, name: str = "s.toml", title: str = "beam", more: str = "") -> Path:
    (folder / name).write_text(HEAD.format(title=title) + REST + more)
    return folder / name


def refused(*words: str) -> str:
    result = CliRunner().invoke(main, list(words))
    assert result.exit_code == 2, result.output
    return result.output


def _declared(model: type, place: tuple[object, ...] = ()) -> set[str]:
    """Places of all keys whose type declares that they name a file."""
    found: set[str] = set()

    def walk(kind: object, at: tuple[object, ...]) -> None:
        if any(isinstance(mark, NamesFile) for mark in getattr(kind, "__metadata__", ())):
            found.add(".".join(map(str, at)))
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            for name, field in kind.model_fields.items():
                if any(isinstance(mark, NamesFile) for mark in field.metadata):
                    found.add(".".join(map(str, (*at, name))))
                walk(field.annotation, (*at, name))
        for part in typing.get_args(kind):
            walk(part, at)

    walk(model, place)
    return found


def keys_of_all() -> list[FileKey]:
    data = frozen(tomllib.loads(ALL_KEYS.format(*(f"file{i}" for i in range(28)))))
    return list(files_named(StudyFile, data))


def test_the_study_of_all_keys_has_every_key_that_is_declared() -> None:
    found = {".".join(str(part) for part in key.place if isinstance(part, str)) for key in keys_of_all()}
    assert found == _declared(StudyFile)
    assert {"identify.record", "identify.frfs", "identify.geometry", "setup.record"} <= _declared(IdentifyFile)


def _base(folder: Path) -> StudyFile:
    return study_from_text((HEAD.format(title="beam") + REST), folder / "s.toml")


@pytest.mark.quick(8)
@pytest.mark.parametrize("name", ["results.json", "damping.toml", "journal/modes-1.npz", "external/updated/in.txt"])
@pytest.mark.parametrize("key", keys_of_all(), ids=lambda key: f"{'.'.join(map(str, key.place))} {key.name}")
def test_an_input_with_the_name_of_a_file_of_the_run_is_refused_before_the_folder_is_touched(
    folder: Path, key: FileKey, name: str
) -> None:
    (folder / "run" / name).parent.mkdir(parents=True)
    (folder / "run" / name).write_text("mine")
    names = [f"file{i}" for i in range(28)]
    names[int(key.name.removeprefix("file"))] = f"run/{name}"
    data = frozen(tomllib.loads(ALL_KEYS.format(*names)))
    file = StudyFile.model_construct(**data)
    inputs = named_inputs(file)
    (found,) = [one for one in inputs if one.path == Path("run") / name]
    assert found.what == key.kind.what
    outputs = [folder / "run" / one.name for one in RUN_FILES if not one.folder]
    with pytest.raises(FemtuneError) as caught:
        check_outputs(inputs, outputs, [folder / "run" / one.name for one in RUN_FILES if one.folder])
    assert caught.value.code == "write.overwrites-input"
    assert (folder / "run" / name).read_text() == "mine"


@pytest.mark.parametrize("spelling", ["link", "hard link", "absolute", "dots"])
def test_an_input_is_known_under_every_name(folder: Path, spelling: str) -> None:
    (folder / "run").mkdir()
    target, name = folder / "run" / "results.json", "t.uff"
    shutil.move(folder / "t.uff", target)
    if spelling == "link":
        (folder / name).symlink_to(target)
    elif spelling == "hard link":
        os.link(target, folder / name)
    else:
        name = str(target) if spelling == "absolute" else "run/../run/results.json"
    path = study(folder)
    path.write_text(path.read_text().replace('"t.uff"', f'"{name}"'))
    before = target.read_bytes()
    for word in UPDATES:
        assert "s.toml:6 (test.file)" in refused(word, "s.toml")
    assert target.read_bytes() == before
    assert os.listdir(folder / "run") == ["results.json"]


NAMED = (
    "modes --sensor 5Z+ --uff", "correlate --expand serep --uff", "respond --from 5 --to 9 --step 1 --uff",
    "screen --csv", "plan --csv", "search --front 3 --csv",
)  # fmt: skip


@pytest.mark.parametrize("words", NAMED)
def test_a_file_named_on_the_command_line_is_no_input(folder: Path, words: str) -> None:
    path = study(folder, more='[quantify]\nrepeats = "repeats.csv"\n')
    (folder / "repeats.csv").write_text("1,2\n1,2\n")
    word, *more = words.split()
    message = refused(word, "s.toml", *more, "repeats.csv")
    assert "quantify.repeats" in message
    assert path.with_name("repeats.csv").read_text() == "1,2\n1,2\n"


_READS: dict[str, tuple[str, ...]] = {
    "init": ("d.bdf", "t.uff", "new"), "compare": ("d.bdf", "d.bdf"), "identify": ("t.uff",),
}  # fmt: skip
"""Arguments of commands that do not read a study."""
_WITH: dict[str, tuple[str, ...]] = {
    "modes --uff": ("--sensor", "5Z+"),
    "correlate --uff": ("--expand", "serep"),
    "respond --uff": ("--from", "5", "--to", "9", "--step", "1"),
    "search --csv": ("--front", "3"),
}
"""Options without which another one has no meaning."""


def _writing_options() -> list[str]:
    """Every option of every command that names a file or a folder which femtune writes."""
    context = click.Context(main)
    commands = {name: main.get_command(context, name) for name in main.list_commands(context)}
    return [
        f"{name} {param.opts[0]}"
        for name, command in commands.items()
        if command is not None
        for param in command.params
        if isinstance(param, click.Option) and param.type is FILE
    ]


def test_options_that_name_a_file_are_known() -> None:
    assert len(_writing_options()) > 40
    assert set(_WITH) <= set(_writing_options())


@pytest.mark.quick(6)
@pytest.mark.parametrize("option", _writing_options())
def test_no_option_of_any_command_writes_to_an_input(folder: Path, option: str) -> None:
    study(folder, more='[quantify]\nrepeats = "repeats.csv"\n')
    (folder / "repeats.csv").write_text("1,2\n27,44\n27.1,44.1\n26.9,43.9\n27.05,44.2\n")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    command, name = option.split()
    words = [command, *_READS.get(command, ("s.toml",)), *_WITH.get(option, ())]
    for target in ("s.toml", "d.bdf", "t.uff", "repeats.csv"):
        assert refused(*words, name, target)
        assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_a_catalogue_that_a_study_names_stays(folder: Path) -> None:
    (folder / "run").mkdir()
    text = '[[damping]]\nname = "c"\nof = "joint"\nfields = ["PARAM G"]\nvalue = 0.02\nsd = 0.005\nunit = ""\n'
    text += 'source = "bench"\ndate = "2019-05-01"\nstudy = "bench"\n'
    (folder / "run" / "damping.toml").write_text(text)
    more = '[[parameter]]\nname = "c"\nfields = ["PARAM G"]\nlower = 0.001\nupper = 0.2\nabsolute = true\n'
    study(folder, more=more + 'prior = "run/damping.toml"\n')
    assert "(parameter[2].prior)" in refused("update", "s.toml", "--fresh")
    assert (folder / "run" / "damping.toml").read_text() == text


@pytest.mark.slow
def test_a_catalogue_that_no_run_made_stays_and_that_of_an_earlier_run_goes(folder: Path) -> None:
    ft.update(study(folder))
    catalogue = folder / "run" / "damping.toml"
    catalogue.write_text("# mine\n")
    ft.update("s.toml")
    assert catalogue.read_text() == "# mine\n"
    record = json.loads((folder / "run" / OWNER_FILE).read_text())
    record["files"]["damping.toml"] = sha256(b"# mine\n").hexdigest()
    (folder / "run" / OWNER_FILE).write_text(json.dumps(record))
    ft.update("s.toml")
    assert not catalogue.exists()


def test_a_result_that_no_run_of_the_study_made_is_not_replaced(folder: Path) -> None:
    (folder / "run").mkdir()
    (folder / "run" / "updated.bdf").write_text("mine")
    study(folder)
    assert "updated.bdf was not made by a run of this study" in refused("update", "s.toml")
    assert (folder / "run" / "updated.bdf").read_text() == "mine"


@pytest.mark.slow
def test_a_folder_belongs_to_one_study(folder: Path) -> None:
    first = ft.update(study(folder, "first.toml", "first study"))
    study(folder, "second.toml", "second study")
    kept = {p: p.read_bytes() for p in (folder / "run").rglob("*") if p.is_file()}
    for words in (["run"], ["update", "--fresh"], ["validate"], ["candidates"], ["bootstrap"]):
        message = refused(words[0], "second.toml", *words[1:])
        assert 'another study, first.toml ("first study")' in message
        assert '[output] folder = "run_second"' in message
    with pytest.raises(FemtuneError) as caught:
        ft.report("second.toml")
    assert caught.value.code == "run.other-study"
    assert {p: p.read_bytes() for p in (folder / "run").rglob("*") if p.is_file()} == kept
    assert ft.update("second.toml", output="other").folder == Path("other")
    assert ft.read_results(first.folder).results.study.title == "first study"
    # the steps of one study share the folder, also after a change
    study(folder, "first.toml", "first study, changed")
    ft.update("first.toml")


@pytest.mark.slow
def test_a_folder_without_a_record_is_that_of_its_results(folder: Path) -> None:
    ft.update(study(folder, "first.toml", "first study"))
    (folder / "run" / OWNER_FILE).unlink()
    study(folder, "second.toml", "second study")
    assert 'another study, first.toml ("first study")' in refused("update", "second.toml")
    ft.update("first.toml")
    owner = owner_of(folder / "run", folder)
    assert owner is not None
    assert owner.path is not None
    assert owner.path.samefile("first.toml")


@pytest.mark.slow
def test_renamed_and_moved_studies_keep_their_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ft.update(study(folder))
    (folder / "s.toml").rename(folder / "renamed.toml")
    ft.update("renamed.toml")
    moved = folder.with_name(f"{folder.name}_moved")
    folder.rename(moved)
    monkeypatch.chdir(moved)
    ft.update("renamed.toml")


def test_checksums_are_those_of_all_inputs(folder: Path) -> None:
    (folder / "repeats.csv").write_text("1,2\n27,44\n27.1,44.1\n26.9,43.9\n27.05,44.2\n")
    found = inputs_of(read_study(study(folder, more='[quantify]\nrepeats = "repeats.csv"\n'))).files
    expected = {name: sha256((folder / name).read_bytes()).hexdigest() for name in ("d.bdf", "t.uff", "repeats.csv")}
    assert {one.path: one.sha256 for one in found} == expected


@pytest.mark.slow
def test_all_files_that_were_written_are_named(folder: Path) -> None:
    study(folder, more='[correlate]\nexpand = "serep"\n')
    output = CliRunner().invoke(main, ["update", "s.toml"]).output
    assert "expanded.uff" in output
    made = ft.update("s.toml").files
    assert set(made) == {p.name for p in (folder / "run").iterdir() if p.is_file()} - {OWNER_FILE}
    declared = {name for _, name in made_by("update", _base(folder))} | {"expanded.uff"}
    assert set(made) <= declared


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes")
def test_a_pipe_in_place_of_a_table_is_refused_with_its_key(folder: Path) -> None:
    os.mkfifo(folder / "sd.csv")
    path = study(folder)
    path.write_text(path.read_text().replace('"t.uff"\n', '"t.uff"\ndeviations = "sd.csv"\n'))
    assert "not a file" in refused("check", "s.toml")
    with pytest.raises((FemtuneError, FemtuneErrors)) as caught:
        ft.update("s.toml")
    assert "s.toml:7 (test.deviations)" in str(caught.value)


@pytest.mark.parametrize(
    ("step", "name", "text"),
    [
        ("update", "starts.jsonl", "notes of mine\n"),
        ("update", "bootstrap.jsonl", '{"runs": 3}\n'),
        ("candidates", "candidates.jsonl", ""),
        ("run", "report.html", "<!doctype html><title>Written by hand</title>\n"),
    ],
)
def test_a_file_of_others_with_the_name_of_one_of_a_run_stays(folder: Path, step: str, name: str, text: str) -> None:
    mine = folder / "run" / name
    mine.parent.mkdir()
    mine.write_text(text)
    code = "run.unwritable" if step == "run" else "run.other-file"
    for words in ([], ["--fresh"]):
        assert f"[{code}]" in refused(step, str(study(folder)), *words)
        assert mine.read_text() == text
    assert os.listdir(folder / "run") == [name]


def test_a_refused_run_does_not_take_a_folder_whose_journal_is_not_its_own(folder: Path) -> None:
    (folder / "run" / "journal").mkdir(parents=True)
    (folder / "run" / "journal" / "notes.txt").touch()
    with pytest.raises(RuntimeError, match="refused"), held(_base(folder), folder / "run", "update"):
        raise RuntimeError("refused")
    assert os.listdir(folder / "run") == ["journal"]
    assert os.listdir(folder / "run" / "journal") == ["notes.txt"]


def test_an_identification_replaces_nothing_of_a_study_or_a_user(folder: Path) -> None:
    with held(_base(folder), folder / "run", "update") as place:
        (place.path / "results.json").touch()
    before = sorted(os.listdir(folder / "run"))
    with pytest.raises(FemtuneError) as caught:
        ft.identify("t.uff", output="run")
    check_shown("run.other-study, identify", str(caught.value).replace(str(folder), "FOLDER"))
    assert sorted(os.listdir(folder / "run")) == before
    (folder / "mine").mkdir()
    (folder / "mine" / "modes.csv").write_text("my table\n")
    with pytest.raises(FemtuneError) as caught:
        ft.identify("t.uff", output="mine")
    check_shown("run.other-file, identify", str(caught.value).replace(str(folder), "FOLDER"))
    assert os.listdir(folder / "mine") == ["modes.csv"]
    assert (folder / "mine" / "modes.csv").read_text() == "my table\n"


def test_a_refused_run_leaves_no_folder(folder: Path) -> None:
    def refuse(run: Path) -> None:
        (run / "journal").mkdir()
        raise RuntimeError("refused")

    with pytest.raises(RuntimeError, match="refused"), held(_base(folder), folder / "run", "update") as place:
        refuse(place.path)
    assert not (folder / "run").exists()


def test_a_refused_run_does_not_take_a_folder_that_is_there(folder: Path) -> None:
    (folder / "run").mkdir()
    (folder / "run" / "notes.txt").touch()
    with pytest.raises(RuntimeError, match="refused"), held(_base(folder), folder / "run", "update"):
        raise RuntimeError("refused")
    assert os.listdir(folder / "run") == ["notes.txt"]


def _of_objects(title: str) -> StudyFile:
    return ft.Study(model=ft.read_deck("d.bdf", units="m-kg-s"), title=title).file


def _hold(file: StudyFile) -> None:
    with held(file, Path("run"), "update") as place:
        (place.path / "results.json").touch()


def test_studies_of_objects_share_a_folder_but_not_with_a_file(folder: Path) -> None:
    _hold(_of_objects("first"))
    # a script that was changed runs again
    _hold(_of_objects("second"))
    with pytest.raises(FemtuneError) as caught:
        _hold(read_study_file(study(folder)))
    assert caught.value.code == "run.other-study"


def test_a_study_of_objects_does_not_take_the_folder_of_a_file(folder: Path) -> None:
    _hold(read_study_file(study(folder)))
    with pytest.raises(FemtuneError) as caught:
        _hold(_of_objects("another"))
    assert caught.value.code == "run.other-study"
    # with other tables it is still the study of the file
    _hold(ft.Study("s.toml", modes={"count": 3}).file)
