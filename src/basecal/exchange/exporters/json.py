"""Export of transforms as JSON, with all digits and covariances, as in calibration.json."""

from __future__ import annotations

import json

from basecal.cell.format.plain import numbers
from basecal.exchange.exports.exporter import Exporter, ExportRequest


def export_text(request: ExportRequest) -> str:
    """Format a JSON object with `transforms` by name, the verdict and the source."""
    transforms = {
        transform.name: {
            "parent": transform.parent,
            "child": transform.child,
            "t_m": numbers(transform.estimate.mean.translation),
            "q_xyzw": numbers(transform.estimate.mean.quaternion),
            "matrix": numbers(transform.estimate.mean.matrix),
            "covariance": numbers(transform.estimate.covariance),
            "status": transform.status,
        }
        for transform in request.transforms
    }
    data = {"transforms": transforms, "verdict": request.calibration.verdict, "from": list(request.remarks)}
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


EXPORTER = Exporter("all digits and the covariance", export_text, is_pasted=True)
