"""What `calibrate` answers today on some 1,200 cells, stored; and every difference from it, a line each.

A change of the house changes no answer: `python -m benchmarks.reference` calibrates every cell again and lists each
verdict, finding, transform and sigma that differs. A change that is meant is explained in `explained.yaml`, by a
pattern of cases and a reason, and the reference is stored again (`--store`). One thread for linear algebra
(OMP_NUM_THREADS=1) makes answers repeat to the last digit on one machine; the tolerances cover other machines.
"""
