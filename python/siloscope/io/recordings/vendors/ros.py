"""Recordings of ROS drivers: depth images with camera_info, point clouds, accelerometer and tf."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.io.recordings import compressed_depth, gravity, messages, ros_messages
from siloscope.io.recordings.messages import CAMERAS, CLOUDS, COMPRESSED, OAK
from siloscope.io.recordings.recorded import RecordedSource
from siloscope.io.recordings.recording import Entry, Recording, Topic, or_none
from siloscope.io.recordings.ros_streams import image_of, is_transported, streams_of
from siloscope.io.recordings.streams import Stream
from siloscope.io.source import Options
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

_MILLIMETRES = 0.001
"""Unit of 16UC1 depth in ROS (REP 118)."""


class RosSource(RecordedSource):
    """One stream of a ROS bag."""

    def __init__(self, path: Path, format: str, options: Options, recording: Recording) -> None:
        super().__init__(path, format, options, recording, streams_of(recording))
        self.frame_id = self._first_frame_id()
        self.provenance["frame_id"] = self.frame_id
        if self.stream.kind == "depth":
            self.file_camera = self._camera()
        if self.stream.dtype == "uint16":
            self.file_depth_unit = _MILLIMETRES
            self.provenance["depth_unit_from"] = "ROS (16UC1 is millimetres)"
        self.gravity, self.provenance["gravity_from"] = self._gravity()

    def _decode(self, entry: Entry) -> Frame:
        return Frame(**decode(self.recording, self.stream, entry), timestamp=self._time(entry))

    def _first_frame_id(self) -> str:
        header = or_none(messages.header, self.recording, self.stream.topic, self.stream.topic.entries[0])
        return header.frame_id.lstrip("/") if header else ""

    def _camera(self) -> Camera | None:
        info = _info_of(self.recording, self.stream, self.frame_id)
        if info is None:
            return None
        topic, message = info
        self.provenance["camera_from"] = topic
        if self.options.cameras:
            return None
        return message.camera(f"{self.name}, {topic}", rectified=_is_rectified(self.stream.name))

    def _gravity(self) -> tuple[NDArray[np.float64] | None, str]:
        imus = list(self.recording.of_type("sensor_msgs/Imu"))
        if not imus:
            return None, "no accelerometer recorded"
        transforms = [
            transform
            for topic in self.recording.of_type("tf2_msgs/TFMessage", "tf/tfMessage")
            if "static" in topic.name or topic.name == "/tf"
            for transform in _transforms(self.recording, topic)
        ]
        why = ""
        for topic in imus:
            found, why = _gravity_in(self.recording, topic, self.frame_id, transforms)
            if found is not None:
                return found, f"{topic.name}: {why}"
        return None, why


def decode(recording: Recording, stream: Stream, entry: Entry) -> dict[str, Any]:
    """Depth or points of one message, as fields of `Frame`."""
    topic = stream.topic
    if topic.type in CLOUDS:
        return {"points": ros_messages.cloud_points(messages.cloud(recording, topic, entry))}
    if topic.type in COMPRESSED:
        image = messages.compressed(recording, topic, entry)
        depth = compressed_depth.decompress(image, is_transported(topic, image))
    else:
        depth = ros_messages.depth_pixels(messages.image(recording, topic, entry))
    return {"depth": depth}


def _info_of(recording: Recording, stream: Stream, frame_id: str) -> tuple[str, ros_messages.CameraInfo] | None:
    """The camera_info beside the image's topic, else the only one of the image's frame and size."""
    if stream.topic.type == OAK:
        own = or_none(_read_info, recording, stream.topic)
        return ("the image's transformation", own) if own else None
    infos = {
        topic.name: info for topic in recording.of_type(*CAMERAS) if (info := or_none(_read_info, recording, topic))
    }
    beside = image_of(stream.name).rsplit("/", 1)[0]
    for name in (f"{beside}/camera_info", f"{beside}/calibration"):
        if name in infos:
            return name, infos[name]
    same = [
        (name, info)
        for name, info in infos.items()
        if info.header.frame_id.lstrip("/") == frame_id and (info.width, info.height) == stream.size
    ]
    return same[0] if len({(info.k, info.d) for _, info in same}) == 1 else None


def _is_rectified(topic: str) -> bool:
    return image_of(topic).rsplit("/", 1)[-1].startswith("image_rect")


def _read_info(recording: Recording, topic: Topic) -> ros_messages.CameraInfo:
    return messages.camera_info(recording, topic, topic.entries[0])


def _transforms(recording: Recording, topic: Topic) -> list[ros_messages.Transform]:
    few = topic.entries[:1000]
    messages = (or_none(recording.read, topic, entry) for entry in few)
    read = (or_none(ros_messages.read_transforms, message) for message in messages if message)
    return [transform for transforms in read if transforms for transform in transforms]


def _gravity_in(
    recording: Recording, topic: Topic, frame_id: str, transforms: list[ros_messages.Transform]
) -> tuple[NDArray[np.float64] | None, str]:
    wire = or_none(recording.read, topic, topic.entries[0])
    header = or_none(wire.header) if wire else None
    if header is None:
        return None, f"{topic.name} is damaged"
    rotation = rotation_between(frame_id, header.frame_id.lstrip("/"), transforms)
    if rotation is None:
        return None, f"{topic.name} is in frame '{header.frame_id}', and no tf leads from there to '{frame_id}'"
    found, how = gravity.at_rest(gravity.accelerations(recording, topic))
    return None if found is None else rotation @ found, how


def rotation_between(target: str, source: str, transforms: list[ros_messages.Transform]) -> NDArray[np.float64] | None:
    """Rotation R with ``v_target = R @ v_source`` along a chain of transforms, or None where there is no chain."""
    neighbours: dict[str, dict[str, NDArray[np.float64]]] = {}
    for transform in transforms:
        neighbours.setdefault(transform.child, {})[transform.parent] = transform.rotation
        neighbours.setdefault(transform.parent, {})[transform.child] = transform.rotation.T
    reached = {source: np.eye(3)}
    queue = deque([source])
    while queue and target not in reached:
        frame = queue.popleft()
        for near, rotation in neighbours.get(frame, {}).items():
            if near not in reached:
                reached[near] = rotation @ reached[frame]
                queue.append(near)
    return reached.get(target)
