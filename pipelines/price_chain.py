"""What assets by price share that a chain of stages bakes: sprites, and volumes of shadow."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines import bake_sprites, price

if TYPE_CHECKING:
    from bake.recipe import Entry
    from bake.store import Store


class Chain:
    """An asset whose stages follow from its knobs."""

    def sprite(self, knobs: dict[str, Any]) -> bake_sprites.Sprite:
        """Return the stages that bake it with these knobs."""
        raise NotImplementedError

    def bake(self, store: Store, knobs: dict[str, Any], watch: price.Watch | None) -> Entry:
        """Run them, but for those whose entries are in the store."""
        return bake_sprites.bake(store, self.sprite(knobs), watch)

    def baked(self, store: Store, knobs: dict[str, Any]) -> tuple[Path, ...]:
        """Return the folder of each stage's entry."""
        return tuple(entry.path for entry in bake_sprites.located(store, self.sprite(knobs)))
