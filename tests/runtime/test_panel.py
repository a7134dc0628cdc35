"""The panel without a window: drawn into a framebuffer, pressed by imgui's own events."""

from __future__ import annotations

import numpy as np
import pytest

imgui_bundle = pytest.importorskip("imgui_bundle")

from imgui_bundle import imgui  # noqa: E402

from formats.mesh import Material  # noqa: E402
from runtime import panel_scene  # noqa: E402
from runtime.gui import GROUND, Gui  # noqa: E402
from runtime.overlay import Overlay  # noqa: E402
from runtime.panel import Panel  # noqa: E402
from runtime.panel_parts import Parts  # noqa: E402
from runtime.pass_history import History  # noqa: E402
from runtime.player import Player  # noqa: E402
from runtime.viewer import Viewer  # noqa: E402

pytestmark = pytest.mark.gpu
PICTURE, WIDTH, HEIGHT = 64, 320, 1400
ALL = {
    "sky": {"zenith": [0.1, 0.2, 0.4], "horizon": [0.5, 0.4, 0.3]},
    "fog": {"extinction": 0.05, "radiance": [0.2, 0.3, 0.4]},
    "radial_blur": {"strength": {"times": [0, 2], "values": [0.0, 0.1]}},
    "bloom": {"strength": 0.2},
    "film": {"exposure": 0.2},
}
LIGHTS = [
    {"type": "sun", "to_light": [-0.3, 0.2, 1.0], "irradiance": [3, 2, 1]},
    {"type": "sphere", "position": [1.5, 1.5, 1], "radius": 0.4, "radiance": [2, 4, 12]},
]


@pytest.fixture
def shown(kit, write_scene, ctx, tmp_path, monkeypatch):
    """A panel of a scene with all that it may list, every section unfolded."""
    raw = kit.scene_dict(
        camera={
            "position": [0, 1, 4], "target": [0, 0.5, 0],
            "lens": {"f_number": 1.4, "focus_distance": 4.0},
        },
        time={"duration": 2.0},
        lights=LIGHTS,
        meshes=[{"name": "wall", "source": "meshes/wall.glb", "position": [0, 0, -1]}],
        ground={"albedo": [0.2, 0.2, 0.2]},
        picture=ALL,
    )  # fmt: skip
    assets = {"ball": kit.sphere_asset(), "wall": kit.quad(Material("grey", (0.5, 0.5, 0.5)))}
    folder = write_scene(raw, assets)
    section = Parts.section
    monkeypatch.setattr(Parts, "section", lambda self, name, opened=True: section(self, name))
    monkeypatch.setattr(panel_scene, "OPEN", 9)
    with Player(folder, size=(PICTURE, 36), context=ctx) as player:
        made = Shown(ctx, Viewer(player, tmp_path, lambda text: None))
        yield made
        made.release()


class Shown:
    """A panel, and hands on it."""

    def __init__(self, ctx, viewer):
        self.viewer, self.history, self.times = viewer, History(), set()
        self.gui = Gui(ctx)
        self.panel = Panel(viewer, self.history, 1.0, self.gui.bold)
        self.overlay = Overlay(viewer, 1.0, self.gui.bold)
        self.target = ctx.framebuffer([ctx.texture((PICTURE + WIDTH, HEIGHT), 4)])
        for _ in range(3):
            self.frame()

    def frame(self, shown=True):
        """Go through the panel once; without `shown` nothing is drawn: that takes long."""
        self.times.add(self.viewer.time)
        if self.viewer.changed:
            self.viewer.changed = False
            self.viewer.player.draw(self.viewer.time)
            self.history.add(self.viewer.player.targets.milliseconds)
        size = PICTURE + WIDTH, HEIGHT
        self.gui.begin(size, size, 1 / 60)
        self.panel.draw(PICTURE, WIDTH, HEIGHT)
        self.overlay.draw(PICTURE, HEIGHT, sum(size), 0.0)
        if not shown:
            imgui.render()
            return
        self.target.use()
        self.target.clear(0.0, 0.0, 0.0, 1.0)
        self.gui.end(self.target)

    def seen(self):
        """What is on it (h, w, 3)."""
        self.frame()
        data = np.frombuffer(self.target.read(components=3), np.uint8)
        return data.reshape(HEIGHT, -1, 3)[::-1].astype(int)

    def press(self, x, y, dx=0.0):
        """Press the left button at a place, and drag it by dx."""
        io = self.gui.io
        for event in (
            lambda: io.add_mouse_pos_event(x, y),
            lambda: io.add_mouse_button_event(0, True),
            lambda: io.add_mouse_pos_event(x + dx, y),
            lambda: io.add_mouse_button_event(0, False),
        ):
            event()
            self.frame(shown=False)

    def release(self):
        self.gui.release()
        for texture in self.target.color_attachments:
            texture.release()
        self.target.release()


def test_it_is_drawn_on_its_own_ground_and_leaves_nothing_behind(shown):
    seen = shown.seen()
    # Its left margin has nothing on it
    assert np.abs(seen[5:, PICTURE + 4] - 255 * np.array(GROUND)).max() <= 1
    assert len(np.unique(seen[:, PICTURE:].reshape(-1, 3), axis=0)) > 20
    before = shown.gui.objects
    for _ in range(20):
        shown.frame()
    assert shown.gui.objects == before


def rows(shown, wanted):
    """Press each place of a column of the panel until `wanted()`; False where none does it."""
    for y in range(60, HEIGHT, 7):
        shown.press(PICTURE + 26, y)
        if wanted():
            return True
    return False


def test_a_light_goes_out_where_its_box_is_pressed(shown):
    assert rows(shown, lambda: shown.viewer.edits.lights)
    assert not shown.viewer.edits.lights[0].on
    assert not shown.viewer.player.scene.lights[0].irradiance.at(0.0).any()


def test_everything_can_be_pressed(shown):
    """Every place of the panel, and back again by the edits."""
    shown.viewer.helping = True
    shown.overlay.error, shown.overlay.busy = "scene.toml: wrong", "baking"
    shown.viewer.wipe.keep(shown.viewer.player.frame(0.0))
    for y in range(44, HEIGHT, 27):
        for x in (26, 150, 290):
            shown.press(PICTURE + x, y, 8.0)
            assert not imgui.get_io().want_text_input
    edits = shown.viewer.edits
    assert edits.hidden
    assert edits.off
    assert edits.lights
    assert edits.values
    assert max(shown.times) > 0
