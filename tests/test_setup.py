"""The set-up script: nothing to do costs nothing, and what is missing is named in one line."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="the set-up script needs bash")


def write_program(path: Path, body: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)
    return path


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """An empty checkout, in a folder whose name has a space, with only what set-up reads."""
    folder = tmp_path / "a checkout"
    (folder / "tools").mkdir(parents=True)
    shutil.copy(ROOT / "tools" / "setup.sh", folder / "tools")
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def run_setup(checkout: Path, *arguments: str, **env: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "tools/setup.sh", *arguments],
        cwd=checkout,
        env={"PATH": os.environ["PATH"], **env},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def with_fake_venv(checkout: Path, pip: str = "exit 0", context: str = "exit 0") -> Path:
    """Put a stand-in for .venv/bin/python that records its calls; return the record."""
    calls = checkout / "calls"
    write_program(
        checkout / ".venv" / "bin" / "python",
        f'case "$1 $2 $3" in -V*) echo Python 3.11.0;;\n'
        f'"-m pip install") echo "$@" >>"{calls}"; {pip};;\n-c*) {context};; esac',
    )
    return calls


@pytest.mark.parametrize("python", ["exit 1", "echo no >&2; exit 127"], ids=["old", "broken"])
def test_a_python_that_will_not_do_is_one_line(checkout: Path, python: str) -> None:
    program = write_program(checkout.parent / "bin" / "python", python)
    done = run_setup(checkout, "packages", "view", PYTHON=str(program))
    assert done.returncode == 3
    assert done.stderr.count("\n") == 1
    assert "Python 3.11 or later" in done.stderr


def test_a_missing_venv_module_is_named(checkout: Path) -> None:
    program = write_program(
        checkout.parent / "bin" / "python", '[ "$1" = -m ] && exit 1; echo Python 3.11.0'
    )
    done = run_setup(checkout, "packages", "view", PYTHON=str(program))
    assert done.returncode == 3
    assert "apt-get install python3-venv" in done.stderr.splitlines()[-1]


def test_packages_are_installed_once_and_again_when_the_project_changes(checkout: Path) -> None:
    calls = with_fake_venv(checkout)
    for _ in range(2):
        assert run_setup(checkout, "packages", "view").returncode == 0
    assert len(calls.read_text().splitlines()) == 1
    silent = run_setup(checkout, "packages", "view")
    assert silent.stdout + silent.stderr == ""
    with (checkout / "pyproject.toml").open("a") as file:
        file.write("# changed\n")
    assert run_setup(checkout, "packages", "view").returncode == 0
    assert len(calls.read_text().splitlines()) == 2


def test_what_holds_all_extras_serves_those_who_ask_for_fewer(checkout: Path) -> None:
    calls = with_fake_venv(checkout)
    for extras in ("view,dev", "view"):
        assert run_setup(checkout, "packages", extras).returncode == 0
    assert [line.split()[-1] for line in calls.read_text().splitlines()] == [".[view,dev]"]


def test_a_moved_checkout_is_installed_again(checkout: Path) -> None:
    with_fake_venv(checkout)
    assert run_setup(checkout, "packages", "view").returncode == 0
    moved = checkout.rename(checkout.with_name("elsewhere"))
    done = run_setup(moved, "packages", "view")
    assert "installing packages" in done.stderr


def test_a_failure_of_pip_shows_its_last_lines_and_leaves_no_stamp(checkout: Path) -> None:
    with_fake_venv(checkout, pip="echo no such wheel; exit 1")
    done = run_setup(checkout, "packages", "view")
    assert done.returncode == 3
    assert "no such wheel" in done.stderr
    assert list((checkout / ".venv").glob("installed-*")) == []


def test_settings_of_pip_that_install_elsewhere_are_not_passed_on(checkout: Path) -> None:
    seen = checkout / "seen"
    with_fake_venv(checkout, pip=f'env >"{seen}"')
    run_setup(checkout, "packages", "view", PIP_USER="1", PIP_TARGET="/x", PIP_FIND_LINKS="here")
    lines = seen.read_text().splitlines()
    assert [line for line in lines if line.startswith("PIP_")] == ["PIP_FIND_LINKS=here"]


@pytest.mark.parametrize("user", ["1000", "0"], ids=["user", "root"])
def test_without_opengl_the_last_line_says_what_to_install(checkout: Path, user: str) -> None:
    with_fake_venv(checkout, context="exit 1")
    bin_folder = checkout.parent / "bin"
    for name, body in {
        "id": f"echo {user}",
        "sudo": "exit 1",
        "apt-get": f'echo "$@" >>"{checkout}/apt"; exit 100',
    }.items():
        write_program(bin_folder / name, body)
    done = run_setup(checkout, "opengl", PATH=f"{bin_folder}:{os.environ['PATH']}")
    assert done.returncode == 3
    assert "apt-get install libegl1 libgl1 libgl1-mesa-dri" in done.stderr.splitlines()[-1]
    # Only root may try apt-get: here sudo asks for a password, so it refuses
    assert (checkout / "apt").exists() == (user == "0")


def test_opengl_is_looked_for_once(checkout: Path) -> None:
    with_fake_venv(checkout, context=f'echo tried >>"{checkout}/tries"')
    for _ in range(2):
        assert run_setup(checkout, "opengl").returncode == 0
    assert (checkout / "tries").read_text().split() == ["tried"]


DESK = ("Xvfb", "openbox", "xdotool")


def with_few_programs(checkout: Path, *more: str) -> Path:
    """Make a folder that holds the few programs that set-up needs, and stand-ins for `more`."""
    folder = checkout.parent / "few"
    folder.mkdir(exist_ok=True)
    for name in ("bash", "dirname", "rm", "touch", "cat", "env"):
        found = shutil.which(name)
        assert found is not None
        (folder / name).symlink_to(found)
    for name in more:
        write_program(folder / name, "exit 0")
    return folder


def test_a_desk_that_is_there_is_looked_for_once_and_silently(checkout: Path) -> None:
    with_fake_venv(checkout)
    folder = with_few_programs(checkout, *DESK)
    done = run_setup(checkout, "desk", PATH=str(folder))
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    (folder / "openbox").unlink()
    done = run_setup(checkout, "desk", PATH=str(folder))
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_without_a_desk_one_line_says_what_to_install_and_nothing_fails(checkout: Path) -> None:
    with_fake_venv(checkout)
    folder = with_few_programs(checkout, "Xvfb", "xdotool")
    done = run_setup(checkout, "desk", PATH=str(folder))
    assert done.returncode == 0
    assert done.stderr.count("\n") == 1
    assert "apt-get install xvfb openbox xdotool" in done.stderr


@pytest.mark.parametrize("network", [True, False], ids=["network", "none"])
def test_a_desk_is_installed_where_it_may_be(checkout: Path, network: bool) -> None:
    with_fake_venv(checkout)
    folder = with_few_programs(checkout)
    write_program(folder / "id", "echo 0")
    made = " ".join(f'"{folder}/{name}"' for name in DESK)
    update = f'"update -qq") exit {0 if network else 100};;'
    (folder / "cp").symlink_to(str(shutil.which("cp")))
    install = f'install*"xvfb openbox xdotool") for p in {made}; do cp "{folder}/id" "$p"; done;;'
    write_program(folder / "apt-get", f'case "$*" in {update} {install} esac')
    done = run_setup(checkout, "desk", PATH=str(folder))
    assert done.returncode == 0, done.stderr
    lines = done.stderr.splitlines()
    assert "installing xvfb openbox xdotool" in lines[0]
    assert len(lines) == (1 if network else 2)


def test_mesa_is_installed_where_it_may_be(checkout: Path) -> None:
    with_fake_venv(checkout, context=f'test -e "{checkout}/mesa"')
    bin_folder = checkout.parent / "bin"
    write_program(bin_folder / "id", "echo 0")
    write_program(
        bin_folder / "apt-get",
        f'case "$*" in install*libgl1-mesa-dri*) touch "{checkout}/mesa";; esac',
    )
    done = run_setup(checkout, "opengl", PATH=f"{bin_folder}:{os.environ['PATH']}")
    assert done.returncode == 0, done.stderr
    assert "libegl1 libgl1 libgl1-mesa-dri" in done.stderr
