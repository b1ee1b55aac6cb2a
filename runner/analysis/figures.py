"""Figures of an analysis."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from springline.runner.analysis.analysis import Analysis
from springline.runner.analysis.reaching import AMPLITUDES, LawCurves
from springline.runner.analysis.sensitivity import Sensitivities
from springline.runner.report import COLUMN, LINES, PAGE, house_style, label, legend_above, panels

Floats = NDArray[np.float64]

_MOST_BARS = 12
_QUIET = {"color": "0.55", "linewidth": 0.8, "linestyle": (0, (2, 2))}
