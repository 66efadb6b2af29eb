"""Evaluation of one method: fit it, score recordings, count errors and alarms."""
