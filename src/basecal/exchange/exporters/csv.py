"""Export of transforms as a table, one per row, with all digits and the sigmas along the child's axes."""

from __future__ import annotations

from basecal.exchange.exports.exporter import Exporter, ExportRequest, csv_row

_HEADER = (
    *("name", "parent", "child", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"),
    *("sigma_x_m", "sigma_y_m", "sigma_z_m", "sigma_rx_rad", "sigma_ry_rad", "sigma_rz_rad", "status", "from"),
)


def export_text(request: ExportRequest) -> str:
    """Format comma-separated values with a header; the last column has the source, since CSV has no comments."""
    rows = [csv_row(_HEADER)]
    for transform in request.transforms:
        mean, estimate = transform.estimate.mean, transform.estimate
        values = [*mean.translation, *mean.quaternion, *estimate.sigma_t, *estimate.sigma_r]
        numbers = [repr(float(value) + 0.0) for value in values]
        source = [transform.status, "; ".join(request.remarks)]
        rows.append(csv_row([transform.name, transform.parent, transform.child], [*numbers, *source]))
    return "\n".join(rows) + "\n"


EXPORTER = Exporter("a row for each transform", export_text, is_pasted=True)
