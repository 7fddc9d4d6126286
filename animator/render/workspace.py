"""Memory that outlives one rendering, so that the next need not ask the system for pages."""

import numpy as np

from animator.render.blending import COLOR_SLOT_FLOATS, SLOT_FLOATS
from animator.render.projection import RECORD_FLOATS
from animator.render.tiles import tile_counts

_FIRST_SLOTS_PER_GAUSSIAN = 4


class Workspace:
    """Buffers of one rendering: from its forward pass until its backward pass."""

    def __init__(self, gaussian_count: int, width_px: int, height_px: int, chunk_count: int):
        """Allocate for a number of Gaussians, an image size, and chunks dealt in parallel."""
        self.key = (gaussian_count, width_px, height_px, chunk_count)
        self.grid = tile_counts(width_px, height_px)
        tile_count = self.grid[0] * self.grid[1]
        self.records = np.zeros((gaussian_count, RECORD_FLOATS), np.float32)
        self.sort_keys = np.zeros((2, gaussian_count), np.uint32)
        self.order = np.zeros((2, gaussian_count), np.int32)
        self.tallies = np.zeros((chunk_count, tile_count + 1), np.int32)
        self.spans = np.zeros((gaussian_count, 2), np.int32)
        self.offsets = np.zeros(tile_count + 1, np.int32)
        self.lasts = np.zeros(tile_count, np.int32)
        self._slots = np.zeros((0, SLOT_FLOATS), np.float32)
        self._color_slots = np.zeros((0, COLOR_SLOT_FLOATS), np.float32)
        self.reserve_slots(max(64, _FIRST_SLOTS_PER_GAUSSIAN * gaussian_count // chunk_count))

    def reserve_slots(self, slots_per_chunk: int) -> None:
        """Make room for pairs of a tile and a Gaussian."""
        chunk_count = self.key[-1]
        self.touched = np.zeros((chunk_count, slots_per_chunk), np.int32)
        self.entries = np.zeros((chunk_count * slots_per_chunk, 2), np.int32)

    def slots(self, with_colors: bool) -> np.ndarray:
        """Return the slots for gradients, of either kind; their contents are arbitrary."""
        if with_colors:
            if len(self._color_slots) != len(self.entries):
                self._color_slots = np.zeros((len(self.entries), COLOR_SLOT_FLOATS), np.float32)
            return self._color_slots
        if len(self._slots) != len(self.entries):
            self._slots = np.zeros((len(self.entries), SLOT_FLOATS), np.float32)
        return self._slots


class WorkspacePool:
    """Workspaces that no rendering uses at the moment."""

    def __init__(self):
        self._idle: list[Workspace] = []

    def lease(
        self, gaussian_count: int, width_px: int, height_px: int, chunk_count: int
    ) -> "Lease":
        """Return an idle workspace of these sizes, or a new one.

        Idle workspaces of other sizes are dropped: who changes the size seldom changes it back.
        """
        key = (gaussian_count, width_px, height_px, chunk_count)
        while self._idle:
            workspace = self._idle.pop()
            if workspace.key == key:
                return Lease(self, workspace)
        return Lease(self, Workspace(*key))

    def take_back(self, workspace: Workspace) -> None:
        """Keep a workspace for the next rendering."""
        self._idle.append(workspace)


class Lease:
    """A workspace in use; it goes back to its pool when nobody refers to the lease any more."""

    def __init__(self, pool: WorkspacePool, workspace: Workspace):
        self._pool = pool
        self.workspace = workspace

    def __del__(self):
        self._pool.take_back(self.workspace)
