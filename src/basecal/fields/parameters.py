"""Entries of `cell.yaml` for a robot's kinematic parameters."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator as checks_whole

from basecal.fields.values import Entry, Status


class Parameters(Entry):
    """Prior knowledge of a robot's parameters, with prior mean zero; each kind adds its sigmas."""

    status: Status = "fixed"

    @checks_whole(mode="after")
    def _check_sigmas(self) -> Self:
        sigmas = [name for name in type(self).model_fields if name.startswith("sigma")]
        stated = [name for name in sigmas if getattr(self, name) is not None]
        required = sigmas if self.status == "prior" else []
        if stated != required:
            expected = " and ".join(sorted(required)) or "no sigma"
            raise ValueError(f"status {self.status} takes {expected}, got {' and '.join(sorted(stated)) or 'none'}")
        return self
