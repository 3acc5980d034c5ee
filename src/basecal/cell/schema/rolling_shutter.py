"""Entry of `cell.yaml` for cameras whose rows are exposed one after another."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic import model_validator as checks_whole

from basecal.cell.cell import RollingShutter
from basecal.fields.values import Entry, Sigma, Status

_LONGEST_S = 1e-3  # of a row: an image of a thousand then takes a second. Below 0 where the bottom row comes first.


class RollingShutterEntry(Entry):
    """Row v of an image is seen v times `line_time_s` after its stamp."""

    status: Status = "fixed"
    line_time_s: Annotated[float, Field(ge=-_LONGEST_S, le=_LONGEST_S)] | None = None
    sigma_s: Sigma | None = None

    @checks_whole(mode="after")
    def _as_stated(self) -> RollingShutterEntry:
        if (self.status == "prior") != (self.sigma_s is not None):
            wanted = "takes sigma_s" if self.status == "prior" else "takes no sigma_s"
            raise ValueError(f"status {self.status} {wanted}")
        if self.line_time_s is None and self.status != "free":
            raise ValueError(f"status {self.status} takes line_time_s, the time from a row to the next in seconds")
        return self

    def noun(self) -> RollingShutter:
        """The shutter."""
        return RollingShutter(self.status, self.line_time_s or 0.0, self.sigma_s)


def rolling_shutter_dict(shutter: RollingShutter | None) -> dict[str, object]:
    """The entry `rolling_shutter` of a camera, where something is stated."""
    if shutter is None:
        return {}
    sigma = {} if shutter.sigma_s is None else {"sigma_s": float(shutter.sigma_s)}
    return {"rolling_shutter": {"status": shutter.status, "line_time_s": float(shutter.line_time_s), **sigma}}
