from pathlib import Path

import numpy as np
import pytest
from PIL import Image


class SceneFolder:
    """Writes small inputs with known content."""

    def __init__(self, root: Path):
        self.root = root

    def image(self, name: str, pixels: np.ndarray | tuple = (10, 20, 30), **options) -> Path:
        """Write an image; a color stands for a picture of 12x8 pixels."""
        if isinstance(pixels, tuple):
            pixels = np.broadcast_to(np.uint8(pixels), (8, 12, len(pixels)))
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.ascontiguousarray(pixels)).save(path, **options)
        return path

    def text(self, name: str, content: str | bytes = "") -> Path:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path


@pytest.fixture
def folder(tmp_path) -> SceneFolder:
    return SceneFolder(tmp_path)
