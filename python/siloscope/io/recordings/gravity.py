"""The direction of gravity from an accelerometer that was recorded with the depth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from siloscope.io.recordings.recording import Entry, Recording, Topic, or_none
from siloscope.io.recordings.ros_messages import read_acceleration
from siloscope.parameters import GRAVITY

_TOLERANCE = 1.0
"""How far, in m/s², the mean may be from standard gravity: bias and scale of small accelerometers."""
_SHAKE = 1.0
"""Standard deviation of a sample, in m/s², above which the camera was being moved."""
_FASTEST = 1e4
"""Larger numbers, and NaN, are no accelerations."""
_SAMPLES = 500


def accelerations(recording: Recording, topic: Topic) -> NDArray[np.float64]:
    """Up to 500 samples (N, 3), m/s², spread evenly over the recording; damaged ones left out."""
    few = topic.entries[:: max(1, len(topic.entries) // _SAMPLES)]
    samples = (or_none(_sample, recording, topic, entry) for entry in few)
    return np.array([sample for sample in samples if sample is not None]).reshape(-1, 3)


def _sample(recording: Recording, topic: Topic, entry: Entry) -> NDArray[np.float64]:
    return read_acceleration(recording.read(topic, entry))[1]


def at_rest(samples: NDArray[np.float64]) -> tuple[NDArray[np.float64] | None, str]:
    """Gravity (3,) in m/s², pointing down, in the accelerometer's frame; and how it was found, or why it was not.

    An accelerometer at rest measures minus gravity.
    """
    samples = samples[np.all(np.abs(samples) < _FASTEST, axis=1)]
    if not len(samples):
        return None, "the accelerometer's stream is empty"
    mean = samples.mean(axis=0)
    size = float(np.linalg.norm(mean))
    if abs(size - GRAVITY) > _TOLERANCE:
        return None, f"the accelerometer's mean is {size:.2f} m/s², not gravity"
    if float(np.sqrt(samples.var(axis=0).sum())) > _SHAKE:
        return None, "the camera was moved while recording"
    return -mean, f"mean of {len(samples)} accelerometer samples"
