"""Counts and times of a player's last frame."""

from __future__ import annotations

from typing import Any


def of(player: Any) -> dict[str, Any]:
    """Return what `Player.profile` promises."""
    targets = player.targets
    return {
        "renderer": player.ctx.info["GL_RENDERER"],
        "size": list(targets.size),
        "passes": list(player.called),
        "programs": player.programs.count,
        "textures": targets.texture_count,
        "bytes": targets.texture_bytes,
        "draw_calls": targets.draw_calls,
        "milliseconds": dict(targets.milliseconds),
        "timing": targets.timing,
        "skipped": list(player.skipped),
        "by_pass": _by_pass(player),
    }


def _by_pass(player: Any) -> dict[str, dict[str, int]]:
    textures, calls = player.targets.textures, player.targets.calls
    found = {}
    for name in dict.fromkeys(("start", *player.passes, *textures, *calls)):
        count, size = textures.get(name, (0, 0))
        found[name] = {
            "programs": player.linked.get(name, 0),
            "textures": count,
            "bytes": size,
            "draw_calls": calls.get(name, 0),
        }
    return found
