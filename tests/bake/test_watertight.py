"""No ray leaves a closed mesh, none meets the convex mesh it starts on: any scale, any place."""

import os

import numpy as np
import pytest

from pipelines.studies import watertight

# A million rays over the settings in the ordinary suite; BAKELIGHT_WATERTIGHT=10000000 in each
EACH = int(os.environ.get("BAKELIGHT_WATERTIGHT", "66667"))
SUBJECTS = {subject.kind: subject for subject in watertight.subjects()}
SETTINGS = [(scale, offset) for scale in watertight.SCALES for offset in watertight.OFFSETS]


@pytest.mark.parametrize("kind", SUBJECTS)
def test_subjects_are_closed_and_look_outward(kind: str) -> None:
    subject = SUBJECTS[kind]
    start, end = subject.faces.ravel(), np.roll(subject.faces, -1, axis=1).ravel()
    edges = set(zip(start.tolist(), end.tolist(), strict=True))
    assert len(edges) == subject.faces.size
    assert all((b, a) in edges for a, b in edges)
    a, b, c = (subject.vertices[subject.faces[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


@pytest.mark.parametrize(("scale", "offset"), SETTINGS)
def test_no_ray_leaves(scale: float, offset: float) -> None:
    seed = 100 + SETTINGS.index((scale, offset))
    for subject in SUBJECTS.values():
        assert watertight.leaks(subject, scale, offset, EACH // 3 + 1, seed) == 0


@pytest.mark.parametrize(("scale", "offset"), SETTINGS)
def test_no_ray_meets_the_convex_mesh_it_starts_on(scale: float, offset: float) -> None:
    seed = 100 + SETTINGS.index((scale, offset))
    for kind in ("ball", "box"):
        assert watertight.self_hits(SUBJECTS[kind], scale, offset, EACH // 20 + 1, seed) == 0


def test_a_missing_face_is_found() -> None:
    """One face of 16,128 gone: as many rays leave as it is wide, seen from random places."""
    ball = SUBJECTS["ball"]
    kept = np.delete(ball.faces, 4000, axis=0)
    torn = watertight.Subject("ball", ball.vertices, kept)
    rays = 200_000
    found = watertight.leaks(torn, 1.0, 0.0, rays, 1)
    # Rays from even places inside meet the surface as its area counts, but for those near it
    a, b, c = ball.vertices[ball.faces[4000]]
    area = np.linalg.norm(np.cross(b - a, c - a)) / 2
    expected = rays * area / (4 * np.pi)
    # 19 or so: a Poisson count within 4 of its deviations
    assert abs(found - expected) < 4 * np.sqrt(expected)
    assert expected > 15


def test_without_the_offset_rays_meet_their_own_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watertight, "offset_origins", lambda points, normals: points)
    # Half of them start under their face; those of a box of axis-aligned faces need not
    assert watertight.self_hits(SUBJECTS["ball"], 1.0, 0.0, 10_000, 1) > 1000
