"""From triaxial tests to a law: moduli, yield, hardening, intervals, predictions, report.

Tests on grains and wires give the law `texsol`, stage by stage; tests of a laboratory (`identify_laboratory`) any law that is asked for.
"""

from __future__ import annotations

from .curves import Curves, curves
from .elastic import ElasticFit, elastic_moduli
from .fit import LawFit, fit_law
from .hardening import HardeningFit, Stage, fit_hardening, sensitivity
from .identification import Control, Identification, identify_law
from .interval import Estimate, estimate, jackknife_deviation
from .laboratory import identify_laboratory
from .laboratory_file import LaboratoryTest, read_laboratory
from .laboratory_fit import LaboratoryFit, LaboratoryReplay, fit_laboratory
from .laboratory_interval import LaboratoryEstimate
from .laboratory_replay import LaboratoryRun
from .laboratory_report import write_laboratory_report
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
    "LaboratoryEstimate",
    "LaboratoryFit",
    "LaboratoryReplay",
    "LaboratoryRun",
    "LaboratoryTest",
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
    "fit_laboratory",
    "fit_law",
    "fit_yield",
    "identify_laboratory",
    "identify_law",
    "jackknife_deviation",
    "least_absolute_line",
    "least_squares_line",
    "phase_mismatch",
    "predict",
    "quality_notes",
    "quality_rows",
    "read_laboratory",
    "replay",
    "sensitivity",
    "series_of",
    "write_laboratory_report",
    "write_report",
]
