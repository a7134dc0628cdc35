"""Libraries and machine are named as the tools themselves name them."""

import sys
from importlib.metadata import version

import pytest

from bake import machine


def test_versions_are_those_of_the_distributions() -> None:
    import numpy

    found = machine.versions(["numpy", "PIL", "no_such_library"])
    assert found["numpy"] == numpy.__version__
    assert found["PIL"] is not None
    assert found["no_such_library"] is None


def test_machine_names_what_chooses_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = machine.name.__wrapped__()
    assert f"python {sys.version_info.major}.{sys.version_info.minor}" in plain
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Prescott")
    assert machine.name.__wrapped__() == f"{plain} OPENBLAS_CORETYPE=Prescott"


@pytest.mark.parametrize("name", ["OpenEXR", "scikit_image", "threadpoolctl", "embreex", "pypng"])
def test_names_of_folders_agree_with_their_metadata(name: str) -> None:
    assert machine._installed()[machine._normal(name)] == version(name)
