"""A homogeneous matrix, 16 numbers row by row, in metres."""

from basecal.exchange.controllers.convention import METRE, MatrixConvention

CONVENTION = MatrixConvention(tuple(f"m{i}{j}" for i in range(4) for j in range(4)), METRE, is_by_columns=False)
