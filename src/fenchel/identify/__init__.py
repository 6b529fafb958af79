"""From triaxial tests on grains and wires to the law `texsol`: moduli, yield, hardening, intervals, predictions, report."""

from __future__ import annotations

from .curves import Curves, curves
from .elastic import ElasticFit, elastic_moduli
from .fit import LawFit, fit_law
from .hardening import HardeningFit, Stage, fit_hardening, sensitivity
from .identification import Control, Identification, identify_law
from .interval import Estimate, estimate, jackknife_deviation
from .mismatch import Mismatch, phase_mismatch
from .options import IdentifyOptions, Specimen
from .parameters import LawParameters
from .prediction import Prediction, predict
from .replay import Replay, Simulate, replay
from .report import write_report
from .runs_info import RunsInfo, SampleView, Series, quality_notes, quality_rows, series_of
from .yielding import (
    LineFit,
    YieldFit,
    effective_hardening,
    fit_yield,
    least_absolute_line,
    least_squares_line,
)

__all__ = [
    "Control",
    "Curves",
    "ElasticFit",
    "Estimate",
    "HardeningFit",
    "Identification",
    "IdentifyOptions",
    "LawFit",
    "LawParameters",
    "LineFit",
    "Mismatch",
    "Prediction",
    "Replay",
    "RunsInfo",
    "SampleView",
    "Series",
    "Simulate",
    "Specimen",
    "Stage",
    "YieldFit",
    "curves",
    "effective_hardening",
    "elastic_moduli",
    "estimate",
    "fit_hardening",
    "fit_law",
    "fit_yield",
    "identify_law",
    "jackknife_deviation",
    "least_absolute_line",
    "least_squares_line",
    "phase_mismatch",
    "predict",
    "quality_notes",
    "quality_rows",
    "replay",
    "sensitivity",
    "series_of",
    "write_report",
]
