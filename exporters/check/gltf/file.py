"""A .glb or .gltf, rule after rule."""

from collections.abc import Iterator
from pathlib import Path

from exporters.check.gltf.accessors import Accessors, accessor_problems
from exporters.check.gltf.animations import animation_problems
from exporters.check.gltf.document import open_buffers, read_document
from exporters.check.gltf.meshes import mesh_problems
from exporters.check.gltf.schema import schema_problems
from exporters.check.gltf.skins import influence_problems, skin_problems
from exporters.check.gltf.splats import splat_problems
from exporters.check.gltf.tree import transform_problems, tree_problems
from exporters.check.problem import Problem


def check_gltf(path: Path) -> Iterator[Problem]:
    """Check a glTF file; a document that breaks the schema is not looked into further."""
    document = read_document(path)
    if isinstance(document, list):
        yield from document
        return
    problems = [*schema_problems(document.json)]
    if problems:
        yield from problems
        return
    buffers, problems = open_buffers(document)
    yield from problems
    accessors = Accessors(json=document.json, buffers=tuple(buffers))
    yield from accessor_problems(accessors)
    yield from tree_problems(document.json)
    yield from transform_problems(document.json)
    yield from mesh_problems(accessors)
    yield from skin_problems(accessors)
    yield from influence_problems(accessors)
    yield from animation_problems(accessors)
    yield from splat_problems(accessors)
