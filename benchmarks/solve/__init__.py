"""From a start near the answer to the covariance, beside SciPy, GTSAM and Ceres."""
