"""Ctrl-C while a program still imports its modules: one line, exit status 130."""

import importlib
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

import pytest

PROGRAMS = {"onboard": "onboard", "bus_sim": "bus-sim", "hil": "python -m hil", "deploy": "python -m deploy"}


class PressesControlC:
    """A finder in whose first moment of importing ``name`` a person has enough."""

    def __init__(self, name: str) -> None:
        self._name = name

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname == self._name:
            raise KeyboardInterrupt
        return None


@pytest.mark.parametrize("package", list(PROGRAMS))
def test_a_program_that_is_interrupted_while_it_imports_says_so_in_a_line(
    package: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    main = importlib.import_module(f"{package}.__main__").main
    monkeypatch.delitem(sys.modules, f"{package}.cli", raising=False)
    monkeypatch.setattr(sys, "meta_path", [PressesControlC(f"{package}.cli"), *sys.meta_path])
    with pytest.raises(SystemExit) as caught:
        main([])
    assert caught.value.code == 130
    assert capsys.readouterr().err == f"{PROGRAMS[package]}: interrupted\n"


@pytest.mark.parametrize(("words", "told"), [(["foo"], '"foo" is no command'), ([], "a command is missing")])
def test_a_mistake_at_the_bench_is_one_line(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert importlib.import_module("hil.__main__").main(words) == 2
    assert capsys.readouterr().err == f"python -m hil: {told}; write commission, or see python -m hil --help\n"


def test_an_unknown_command_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        importlib.import_module("onboard.__main__").main(["watch"])
    told = capsys.readouterr().err
    assert caught.value.code == 2 and told.count("\n") == 1
    assert '"watch" is no command; write trace, web, gateway, operate, conform, keys, or --machine FILE' in told
