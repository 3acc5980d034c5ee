"""The levels of significance of this package's findings."""

from __future__ import annotations

# Chance by which a finding is made of data that are as stated. Ten tests of a calibration then raise one alarm in a
# thousand, so that a warning is worth a look.
SIGNIFICANCE = 1e-4
# Likewise of a finding that data which were held out have to confirm besides: most that chance makes, they do not.
CONFIRMED_SIGNIFICANCE = 1e-3
