"""One formula, three arithmetics: floats, intervals with outward rounding, and duals of either."""

from tpm_design.arithmetic import kernel_cache  # noqa: F401  (before Numba)

# isort: split
from tpm_design.arithmetic.compilation import FAST_MATH, fast_kernel, inlined, inner, kernel, short_kernel
from tpm_design.arithmetic.dual import Dual, variables
from tpm_design.arithmetic.formula import derived, formula
from tpm_design.arithmetic.functions import (
    arctangent2,
    cosine,
    direction,
    direction_cosine,
    greater,
    lesser,
    magnitude,
    pos,
    root,
    sine,
    sqr,
)
from tpm_design.arithmetic.interval import Interval

__all__ = [
    "FAST_MATH",
    "Dual",
    "Interval",
    "arctangent2",
    "cosine",
    "derived",
    "direction",
    "direction_cosine",
    "fast_kernel",
    "formula",
    "greater",
    "inlined",
    "inner",
    "kernel",
    "lesser",
    "magnitude",
    "pos",
    "root",
    "short_kernel",
    "sine",
    "sqr",
    "variables",
]
