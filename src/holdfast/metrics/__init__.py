"""Metrics of decisions: by sample, by event, pooled over recordings, with intervals."""

from holdfast.metrics.decisions import Decisions, FingerDecisions, hand_decisions
from holdfast.metrics.events import (
    AlarmMatch,
    EventMetrics,
    InstabilityEvent,
    event_metrics,
    match_alarms,
    match_decisions,
    pool_events,
)
from holdfast.metrics.samples import SampleMetrics, calibration_sums, sample_metrics
from holdfast.metrics.statistics import Interval, bootstrap_interval, ratio_of_sums
from holdfast.metrics.summary import (
    Intervals,
    Metrics,
    RecordingMetrics,
    RecordingResults,
    ResultTotal,
    score_recording,
    summarise,
)

__all__ = [
    "AlarmMatch",
    "Decisions",
    "EventMetrics",
    "FingerDecisions",
    "InstabilityEvent",
    "Interval",
    "Intervals",
    "Metrics",
    "RecordingMetrics",
    "RecordingResults",
    "ResultTotal",
    "SampleMetrics",
    "bootstrap_interval",
    "calibration_sums",
    "event_metrics",
    "hand_decisions",
    "match_alarms",
    "match_decisions",
    "pool_events",
    "ratio_of_sums",
    "sample_metrics",
    "score_recording",
    "summarise",
]
