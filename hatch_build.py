"""What a wheel installs beside the package: the manual page and completions, made by the package itself."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_PLACES = {
    "man": "share/man/man1/basecal.1",
    "bash": "share/bash-completion/completions/basecal",
    "zsh": "share/zsh/site-functions/_basecal",
    "fish": "share/fish/vendor_completions.d/basecal.fish",
}


class ManualHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds them where the package can be imported: `make dist` builds in an environment that holds what it needs."""

    _folder: TemporaryDirectory[str] | None = None

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Write the files, and name where they are installed."""
        sys.path.insert(0, str(Path(self.root) / "src"))
        try:
            from basecal.cli.completion import completion_text
        except ImportError:
            return
        self._folder = TemporaryDirectory()
        folder = Path(self._folder.name)
        for kind, place in _PLACES.items():
            (folder / kind).write_text(completion_text(kind) + "\n", encoding="utf-8")
            build_data["shared_data"][str(folder / kind)] = place

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the files: the wheel holds them."""
        if self._folder:
            self._folder.cleanup()
