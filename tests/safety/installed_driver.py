"""A driver by others as pip would install it: a module and the metadata of a package, in a folder of `sys.path`."""

from __future__ import annotations

import shutil
import sys
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def installed_driver(folder: Path, kind: str, module: Path):
    """The folder, with the module as driver `kind`, which this process and those it starts find while this lasts."""
    folder.mkdir(exist_ok=True)
    shutil.copy(module, folder / f"{kind}.py")
    metadata = folder / f"{kind}-0.1.dist-info"
    metadata.mkdir(exist_ok=True)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {kind}\nVersion: 0.1\n")
    (metadata / "entry_points.txt").write_text(f"[basecal.drivers]\n{kind} = {kind}\n")
    sys.path.insert(0, str(folder))
    try:
        yield folder
    finally:
        sys.path.remove(str(folder))
        sys.modules.pop(kind, None)
