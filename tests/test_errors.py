"""How errors read, and how several are shown together."""

from __future__ import annotations

import pytest

from femtune.errors import ErrorCollector, FemtuneError, FemtuneErrors, Notice, Where, did_you_mean, each


def _error(code: str = "deck.some-problem") -> FemtuneError:
    where = Where("bridge.bdf", 42, "CBAR 7")
    return FemtuneError(code, "bar 7 has no property", where=where, values={"pid": 3}, hint="add PBAR 3")


def test_an_error_says_what_where_which_values_and_how_to_mend_it() -> None:
    assert str(_error()).splitlines() == [
        "[deck.some-problem] bar 7 has no property",
        "  at bridge.bdf:42 (CBAR 7)",
        "  pid = 3",
        "",
        "hint: add PBAR 3",
    ]


@pytest.mark.parametrize(
    ("where", "text"),
    [
        (Where("a.bdf"), "a.bdf"),
        (Where("a.bdf", 3), "a.bdf:3"),
        (Where("", None, "modes.count"), "modes.count"),
        (Where("a.uff", None, "data set 55"), "a.uff (data set 55)"),
    ],
)
def test_a_place(where: Where, text: str) -> None:
    assert str(where) == text
    assert str(FemtuneError("a.b", "x", where=where)).endswith(f"  at {text}")


def test_no_place_leaves_no_empty_line() -> None:
    assert str(FemtuneError("a.b", "x", where=Where())) == "[a.b] x"
    assert str(Notice("a.b", "x", Where())) == "[a.b] x"


def test_what_a_file_holds_cannot_steer_the_terminal() -> None:
    text = str(FemtuneError("a.b", "card '\x1b[2J\x07' is unknown", values={"text": "é\r\x00"}))
    assert "\x1b" not in text
    assert "\\x1b[2J\\x07" in text
    assert "é\\r\\x00" in text


def test_one_gathered_error_is_raised_as_it_is() -> None:
    gathered, alone = ErrorCollector(), _error()
    with gathered.catch():
        raise alone
    with pytest.raises(FemtuneError) as caught:
        gathered.raise_if_any()
    assert caught.value is alone


def test_several_errors_are_shown_together_and_flat() -> None:
    inner, outer = ErrorCollector(), ErrorCollector()
    for code in ("deck.one", "deck.two"):
        with inner.catch():
            raise _error(code)
    with outer.catch():
        inner.raise_if_any()
    with outer.catch():
        raise _error("deck.three")
    with pytest.raises(FemtuneErrors) as caught:
        outer.raise_if_any()
    assert [e.code for e in caught.value.errors] == ["deck.one", "deck.two", "deck.three"]
    assert str(caught.value).startswith("3 problems:\n\n[deck.one]")
    assert caught.value.code == "deck.one"


@pytest.mark.parametrize("wrong", [20, 21, 30])
def test_the_last_of_too_many_errors_says_that_reading_stopped(wrong: int) -> None:
    def refused(item: int) -> None:
        raise _error(f"deck.number-{item}")

    with pytest.raises(FemtuneErrors) as caught:
        each(refused, range(wrong))
    assert [e.code for e in caught.value.errors] == [f"deck.number-{i}" for i in range(20)]
    more = "; reading stopped after 20 errors, and more lines may be wrong" if wrong > 20 else ""
    assert caught.value.errors[-1].hint == f"add PBAR 3{more}"


def test_a_collector_lets_programming_errors_through_and_nothing_is_nothing() -> None:
    gathered = ErrorCollector()
    with pytest.raises(ZeroDivisionError), gathered.catch():
        _ = 1 / 0
    gathered.raise_if_any()


def test_the_closest_word_is_named() -> None:
    assert did_you_mean("frequncy_sd", ["frequency_sd", "shape_sd"]) == "did you mean 'frequency_sd'?"
    assert did_you_mean("zzz", ["b", "a"]) == "known: a, b"
    assert did_you_mean("zzz", []) == ""
