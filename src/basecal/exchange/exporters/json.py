"""Export of transforms as JSON, with all digits and covariances, as in calibration.json."""

from __future__ import annotations

import json

from basecal.cell.format.plain import numbers
from basecal.exchange.exports.exporter import Exporter, Wanted


def export_text(request: Wanted) -> str:
    """Format a JSON object with `transforms` by name, the verdict and the source."""
    transforms = {
        one.name: {
            "parent": one.parent,
            "child": one.child,
            "t_m": numbers(one.estimate.mean.translation),
            "q_xyzw": numbers(one.estimate.mean.quaternion),
            "matrix": numbers(one.estimate.mean.matrix),
            "covariance": numbers(one.estimate.covariance),
            "status": one.status,
        }
        for one in request.transforms
    }
    data = {"transforms": transforms, "verdict": request.calibration.verdict, "from": list(request.remarks)}
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


EXPORTER = Exporter("all digits and the covariance", export_text, is_pasted=True)
