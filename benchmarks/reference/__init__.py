"""Stored answers of `calibrate` on some 1,200 cells, and a list of every difference from them.

A refactoring changes no answer: `python -m benchmarks.reference` calibrates every cell again and lists each verdict,
finding, transform and sigma that differs. An intended change is explained in `explained.yaml`, by a pattern of cases
and a reason, and the reference is stored again (`--store`). One thread for linear algebra (OMP_NUM_THREADS=1) makes
answers repeat to the last digit on one machine; the tolerances cover other machines.
"""
