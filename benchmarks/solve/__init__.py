"""Time from a start near the answer to the covariance, compared with SciPy, GTSAM and Ceres."""
