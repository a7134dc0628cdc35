"""What the documents say exists: targets, commands, links, reasons for dependencies."""

import importlib
import re
import tomllib
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CONVENTIONS.md")


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def make_targets() -> set[str]:
    return set(re.findall(r"^([a-z][a-z-]*):(?!=)", text_of("Makefile"), flags=re.MULTILINE))


def test_every_dependency_is_in_the_changelog_with_its_reason() -> None:
    project = tomllib.loads(text_of("pyproject.toml"))["project"]
    wanted = [*project["dependencies"], *chain(*project["optional-dependencies"].values())]
    names = {re.split(r"[<>=!~\[; ]", requirement)[0] for requirement in wanted}
    rows = re.findall(r"^\| ([\w.-]+)(?: \(extra[^)]*\))? \| \S", text_of("CHANGELOG.md"), re.M)
    assert len(names) > 10
    assert set(rows) - {"package", "---"} == names


@pytest.mark.parametrize("name", DOCUMENTS)
def test_make_targets_in_the_documents_exist(name: str) -> None:
    used = re.findall(r"(?:^ {4}|`)make ([a-z-]+)", text_of(name), flags=re.MULTILINE)
    assert set(used) <= make_targets()


def test_the_makefile_has_the_promised_targets() -> None:
    promised = "help demo bake view test check bench study images setup clean"
    assert set(promised.split()) <= make_targets()


@pytest.mark.parametrize("name", DOCUMENTS)
def test_links_between_documents_resolve(name: str) -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)", text_of(name))
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_the_readme_names_every_command_and_no_other() -> None:
    cli, single = (importlib.import_module(f"pipelines.{name}") for name in ("cli", "single"))
    single.add_to(cli.cli)
    named = set(re.findall(r"`bakelight ([a-z]+)", text_of("README.md")))
    assert named == set(cli.cli.commands)
