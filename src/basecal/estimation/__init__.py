"""Everything unknown from everything seen: starts, maximum likelihood, covariance."""
