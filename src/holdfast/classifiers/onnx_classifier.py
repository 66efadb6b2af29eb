"""A classifier that JSON cannot hold: an ONNX file beside the model, run by onnxruntime."""

from functools import lru_cache
from hashlib import sha256
from importlib import import_module
from pathlib import PurePath
from typing import Any, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.classifiers.linear import feature_rows
from holdfast.classifiers.onnx_check import ROW_LIMIT, checked, line, run_rows
from holdfast.errors import MissingExtra, ModelError
from holdfast.files import file_stem
from holdfast.sensors.types import Array

MAX_ONNX_SIZE = 1 << 24
"""Maximum size of an ONNX file [bytes]."""
INPUT_TYPES: dict[str, type[np.floating[Any]]] = {
    "tensor(float)": np.float32,
    "tensor(double)": np.float64,
}
"""Types of the input, by onnxruntime's names."""


class Onnx(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, tag="onnx"):
    """Classifier in an ONNX file: (n, n_features) to a probability, (n,) or (n, 1).

    Attributes:
        file: name of the ONNX file, in the folder of the model file.
        sha256: digest of its content, in hexadecimal.
        n_features: number of features of its input.
        content: of the ONNX file; a model file does not hold it.

    Raises:
        ModelError: the file is not a plain name that ends in .onnx, the content is too large, has
            another digest or names other files, or there is no feature.
    """

    file: str
    sha256: str
    n_features: int
    content: bytes = b""

    def __post_init__(self) -> None:
        name = PurePath(self.file)
        if name.suffix != ".onnx" or file_stem(name.stem) + ".onnx" != self.file:
            raise ModelError(f"the name of an .onnx file without folders expected, {self.file!r}")
        if self.n_features < 1:
            raise ModelError(f"at least one feature expected, {self.n_features} given")
        if not self.content:
            return
        if len(self.content) > MAX_ONNX_SIZE:
            raise ModelError(f"{self.file} has more than {MAX_ONNX_SIZE} bytes")
        if sha256(self.content).hexdigest() != self.sha256:
            raise ModelError(f"{self.file} is not the file of the model: its sha256 differs")
        if b"location" in self.content:  # the key by which ONNX finds data in another file
            raise ModelError(f"{self.file} keeps data in other files; a single file expected")

    @classmethod
    def of(cls, content: bytes, n_features: int) -> Self:
        """Return the classifier of an ONNX content, in a file that is named by its digest."""
        digest = sha256(content).hexdigest()
        return cls(f"{digest[:16]}.onnx", digest, n_features, content)

    def probability(self, features: npt.ArrayLike) -> Array:
        """Return the probability of each row of (n, n_features); NaN if it has NaN.

        Raises:
            MissingExtra: onnxruntime is not installed.
            ModelError: the ONNX file is invalid, or returns no probabilities.
            ValueError: the number of features is not `n_features`.
        """
        rows = feature_rows(features, self.n_features)
        probabilities = np.full(len(rows), np.nan)
        known = ~np.isnan(rows).any(axis=1)
        if not known.any():
            return probabilities
        # An ONNX file comes from anyone: what it returns is checked, not clipped.
        session, name, dtype = _session(self.content, self.n_features)
        output = run_rows(session, name, rows[known].astype(dtype)).astype(np.float64)
        n = int(known.sum())
        if output.shape not in ((n,), (n, 1)):
            raise ModelError(f"{self.file}: {n} probabilities expected, {output.shape}")
        if not ((output >= 0) & (output <= 1)).all():
            raise ModelError(f"{self.file}: probabilities from 0 to 1 expected")
        probabilities[known] = output.reshape(n)
        return probabilities


@lru_cache(maxsize=8)
def _session(content: bytes, n_features: int) -> tuple[Any, str, type[np.floating[Any]]]:
    """Return the session of an ONNX content, which is checked first, with its input's facts."""
    try:
        onnxruntime = import_module("onnxruntime")
    except ImportError as cause:
        raise MissingExtra("onnxruntime", "onnx") from cause
    content = checked(content, n_features)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # rows are few
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(
            content, sess_options=options, providers=["CPUExecutionProvider"]
        )
    except Exception as cause:  # the classes of onnxruntime derive from Exception alone
        raise ModelError(f"the ONNX file of the model is invalid: {line(cause)}") from cause
    inputs = session.get_inputs()
    if len(inputs) != 1 or inputs[0].type not in INPUT_TYPES or len(session.get_outputs()) != 1:
        raise ModelError("an ONNX file with one input of floating-point numbers, and one output")
    name, dtype = inputs[0].name, INPUT_TYPES[inputs[0].type]
    # One row first, against its own limit: a file that is too slow is refused at once.
    run_rows(session, name, np.zeros((1, n_features), dtype), ROW_LIMIT)
    return session, name, dtype
