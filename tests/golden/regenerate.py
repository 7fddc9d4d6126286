"""Write the golden files again: `python -m tests.golden.regenerate [CASE...]`.

A CASE is a clip (`chain`) or a clip and a format (`chain.gltf`); none means all. Prints what
changes in meaning: read it, and say in the commit why it should.
"""

import json
import sys
import tempfile
from pathlib import Path

from tests.golden.cases import CLIPS, FORMATS, GOLDENS, golden_path
from tests.golden.compare import differences
from tests.golden.semantics import to_text


def regenerate(name: str, form: str) -> list[str]:
    """Write one golden file if its meaning changed; return the differences to the old one."""
    with tempfile.TemporaryDirectory() as folder:
        found = FORMATS[form](CLIPS[name](), Path(folder))
    path = golden_path(name, form)
    changes = ["new"]
    if path.exists():
        changes = differences(json.loads(path.read_text(encoding="utf-8")), found)
    if changes:
        path.parent.mkdir(exist_ok=True)
        path.write_text(to_text(found) + "\n", encoding="utf-8")
    return changes


def main(arguments: list[str]) -> int:
    """Regenerate the cases named, or all; return 2 for an unknown one."""
    known = {f"{name}.{form}" for name, form in GOLDENS} | set(CLIPS)
    unknown = sorted(set(arguments) - known)
    if unknown:
        sys.stderr.write(f"unknown: {', '.join(unknown)}; known: {', '.join(sorted(known))}\n")
        return 2
    for name, form in GOLDENS:
        case = f"{name}.{form}"
        if arguments and name not in arguments and case not in arguments:
            continue
        changes = regenerate(name, form)
        sys.stdout.write(f"{case}: {len(changes) or 'no'} difference(s)\n")
        sys.stdout.writelines(f"  {line}\n" for line in changes)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
