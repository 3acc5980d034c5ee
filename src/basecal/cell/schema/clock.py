"""Entry of `cell.yaml` for the clock of a robot or a camera."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic import model_validator as checks_whole

from basecal.cell.cell import Clock
from basecal.fields.values import Entry, Sigma, Status

_MOST_JITTER_S = 1.0  # with more an image tells nothing of an arm that moves
_FARTHEST_S = 1e12  # either way, as far as stamps may be: one clock may count since 1970, another since its start


class ClockEntry(Entry):
    """The stamps of a device plus `offset_s` are the reference's."""

    status: Status = "fixed"
    offset_s: Annotated[float, Field(ge=-_FARTHEST_S, le=_FARTHEST_S)] = 0.0
    sigma_s: Sigma | None = None
    jitter_s: Annotated[float, Field(ge=0, le=_MOST_JITTER_S)] | None = None

    @checks_whole(mode="after")
    def _sigma_of_prior(self) -> ClockEntry:
        if (self.status == "prior") != (self.sigma_s is not None):
            wanted = "takes sigma_s" if self.status == "prior" else "takes no sigma_s"
            raise ValueError(f"status {self.status} {wanted}")
        return self

    def noun(self) -> Clock:
        """The clock."""
        return Clock(self.status, self.offset_s, self.sigma_s, self.jitter_s)


def clock_dict(clock: Clock | None) -> dict[str, object]:
    """The entry `clock` of a robot or a camera, where something is stated."""
    if clock is None:
        return {}
    sigma = {} if clock.sigma_s is None else {"sigma_s": float(clock.sigma_s)}
    jitter = {} if clock.jitter_s is None else {"jitter_s": float(clock.jitter_s)}
    return {"clock": {"status": clock.status, "offset_s": float(clock.offset_s), **sigma, **jitter}}
