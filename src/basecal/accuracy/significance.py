"""The one level of significance of this package's findings."""

from __future__ import annotations

# Chance by which a finding is made of data that are as stated. Ten tests of a calibration then raise one alarm in a
# thousand, so that a warning is worth a look.
SIGNIFICANCE = 1e-4
