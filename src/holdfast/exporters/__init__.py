"""Exports: a model for programs without Python, recordings for other tools."""

from holdfast.detection.c_header import CHeader, header_of
from holdfast.exporters.model_export import ExportedModel, export, fingers_of_sensor

__all__ = ["CHeader", "ExportedModel", "export", "fingers_of_sensor", "header_of"]
