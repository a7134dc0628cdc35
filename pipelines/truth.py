"""The traced truth of what a window shows, refined beside it until something else is asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from formats import scene as scenes
from formats.errors import BakelightError
from formats.keyed import Keyed
from formats.scene import EnvironmentLight, Scene, Sun
from pipelines.beside import Beside, Ended
from pipelines.trace_truth import PLACING, Request, trace
from runtime import lighting
from runtime.camera import Camera
from runtime.player import Player
from runtime.truth import Traced


class Truth:
    """Begins tracings of what players show, as runtime.truth.Truth wants it; one at a time.

    path : the scene's file. root : where its sources start; None finds it.
    """

    def __init__(self, path: Path, root: Path | None, threads: int = 0) -> None:
        self._path, self._threads = path, threads
        self._root = scenes.load(path).root if root is None else root
        self._beside = Beside(trace)
        self._latest: Tracing | None = None

    def __call__(self, player: Player, time: float) -> Tracing:
        """Trace what a player shows; the tracing before gets no further."""
        if self._latest is not None:
            self._latest.close()
        try:
            scene = shown(player, time, self._path, self._root)
        except BakelightError as error:
            self._latest = Tracing(None, str(error))
            return self._latest
        size = player.targets.size
        self._beside.ask(Request(scene, time, size, self._threads))
        self._latest = Tracing(self._beside)
        return self._latest

    def close(self) -> None:
        """End the process beside."""
        self._beside.stop()


class Tracing:
    """A tracing under way; see runtime.truth.Tracing."""

    def __init__(self, beside: Beside | None, error: str | None = None) -> None:
        self._beside = beside
        self.busy: str | None = "preparing to trace" if beside else None
        self.error = error

    def poll(self) -> Traced | None:
        """Return the newest picture where there is one since the last call; never waits."""
        newest = None
        for message in self._beside.poll() if self._beside else ():
            if isinstance(message, Traced):
                newest = message
            elif isinstance(message, Ended):
                self.busy, self.error, self._beside = None, message.error, None
                break
            else:
                self.busy = message
        return newest

    def close(self) -> None:
        """Stop it; in a long step with its process, which starts again in seconds."""
        if self._beside is not None and self.busy == PLACING:
            self._beside.stop()
        elif self._beside is not None:
            self._beside.drop()
        self.busy = self._beside = None


def shown(player: Player, time: float, path: Path, root: Path | None) -> Scene:
    """Return the scene that a player shows at `time` seconds, ready to be traced.

    Its sources are found again, lights that the plan left out are back, camera and sun stand as
    hands have put them, what is hidden or switched off is gone. Soft shadows cannot be hidden from
    rays.
    """
    scene: Scene = player.scene
    declared = scenes.from_dict(scene.raw, where=path, root=root, name=scene.name)
    places = {Path(written): found for written, found in declared.sources.items()}

    def found(each: Any) -> Any:
        return replace(each, source=places.get(each.source, each.source))

    left_out = {row["index"] for row in player.plan.get("lights", []) if not row["kept"]}
    kept = iter(scene.lights)
    lights = [own if i in left_out else next(kept) for i, own in enumerate(declared.lights)]
    lights = [found(light) if isinstance(light, EnvironmentLight) else light for light in lights]
    picture, off = scene.picture, player.off
    picture = replace(
        picture,
        sky=None if "sky" in off else picture.sky,
        fog=None if "fog" in off else picture.fog,
        bloom=None if "bloom" in off else picture.bloom,
        radial_blur=None if "radial_blur" in off else picture.radial_blur,
    )
    return replace(
        scene,
        raw={},
        sources={},
        camera=_held(scene, player, time),
        lights=tuple(_turned(lights, player.sun_turn, time)),
        ground=None if "ground" in off else scene.ground,
        meshes=tuple(found(m) for m in scene.meshes if player.shows("mesh", m.name)),
        billboards=tuple(found(b) for b in scene.billboards if player.shows("billboard", b.name)),
        voxels=found(scene.voxels) if scene.voxels else None,
        picture=picture,
    )


def _held(scene: Scene, player: Player, time: float) -> scenes.Camera:
    """The camera as it is now, for all times."""
    view = player.camera or Camera.of_scene(scene, time)
    lens = scene.camera.lens
    if lens is not None:
        no_lens = view.f_number is None or view.focus_distance is None or "lens" in player.off
        lens = None if no_lens else replace(
            lens, f_number=Keyed.hold(view.f_number), focus_distance=Keyed.hold(view.focus_distance)
        )  # fmt: skip
    return replace(
        scene.camera,
        position=Keyed.hold(view.position),
        target=Keyed.hold(view.target),
        focal_length_mm=Keyed.hold(1e3 * view.focal_length),
        sensor_height_mm=1e3 * view.sensor_height,
        lens=lens,
    )


def _turned(lights: list[Any], turn: tuple[float, float], time: float) -> Iterator[Any]:
    """Turn the first sun as the player does."""
    first = True
    for light in lights:
        if first and isinstance(light, Sun):
            first = False
            if any(turn):
                towards = lighting.turned(light.direction(time), *turn)
                light = replace(light, to_light=Keyed.hold(towards))
        yield light
