"""Studies and the store: what was baked is found again, a changed knob bakes what is behind it."""

from collections import Counter
from pathlib import Path

import pytest

from bake.store import Store
from pipelines.studies import harmonics, shadow_truth, stages, subjects
from pipelines.studies.occlusion_encodings import TALK, Bench
from tests.pipelines.test_studies import QUICK


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Count the stages that run, by name."""
    found: Counter[str] = Counter()
    plain = Store._publish

    def counted(store: Store, kind: object, path: Path, *more: object) -> None:
        found[path.name[:-65]] += 1
        plain(store, kind, path, *more)

    monkeypatch.setattr(Store, "_publish", counted)
    return found


def test_a_study_runs_again_without_baking(runs: Counter[str], tmp_path: Path) -> None:
    answers = []
    for _ in range(2):
        with stages.into(tmp_path / "store", tmp_path / "bakes.json"):
            answers.append(harmonics.measure(QUICK))
    # Four numbers of terms
    assert runs == {"bake.billboard.trace": 4}
    # What a bake took is what it took then
    assert [r["bake_seconds"] for r in answers[0].rows] == [
        r["bake_seconds"] for r in answers[1].rows
    ]
    assert answers[0].title == answers[1].title
    assert all(float(row["bake_seconds"]) > 0 for row in answers[0].rows)


def test_without_a_store_the_same_is_measured(tmp_path: Path) -> None:
    plain = harmonics.measure(QUICK)
    with stages.into(tmp_path / "store", tmp_path / "bakes.json"):
        through = harmonics.measure(QUICK)
    assert [r["error"] for r in plain.rows] == [r["error"] for r in through.rows]


def test_a_changed_knob_bakes_only_what_is_behind_it(runs: Counter[str], tmp_path: Path) -> None:
    """Of a volume: its encoding, not its rays; its rays, and then both."""
    changes = [{}, {"encoding": "bands", "size": 32}, {"rays": 128}]
    expected = [(1, 1), (0, 1), (1, 1)]
    with stages.into(tmp_path / "store", tmp_path / "bakes.json"):
        for change, (rays, codes) in zip(changes, expected, strict=True):
            runs.clear()
            volume = {"grid": 8, "rays": 64, "l_max": 3, **change}
            shadow_truth.play({"any": volume}, (0.0,), (16, 9), simple)
            assert runs["bake.occlusion.trace"] == rays
            assert runs["bake.compress.compress"] == codes
            # Nothing else of the scene is baked again
            assert (sum(runs.values()) == rays + codes) == bool(change)


def simple(data: dict) -> None:
    """Leave one caster of the scene, lit directly."""
    data["meshes"] = [mesh for mesh in data["meshes"] if mesh.get("shadow")][:1]
    for mesh in data["meshes"]:
        mesh.pop("transfer", None)
        mesh["lighting"] = "direct"


def test_studies_of_one_mesh_share_its_volumes(runs: Counter[str], tmp_path: Path) -> None:
    mesh = subjects.Setting(quick=True).meshes("knot")["knot"]
    with stages.into(tmp_path / "store", tmp_path / "bakes.json"):
        for _ in range(2):
            bench = Bench("knot", mesh, {})
            bench.trace(grid=6, rays=64)
            bench.trace(grid=6, rays=128)
    assert runs == {"bake.occlusion.trace": 2}
    assert TALK.encoding == "talk"
