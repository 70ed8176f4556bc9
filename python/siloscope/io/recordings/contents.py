"""What is in a recording: every topic with its type and count, and why it is or isn't read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from siloscope.errors import InputError
from siloscope.io.recordings.messages import CAMERAS, CLOUDS, COMPRESSED, IMAGES
from siloscope.io.recordings.recording import Recording, Topic
from siloscope.io.recordings.ros_streams import stream_of
from siloscope.io.recordings.streams import Stream, described
from siloscope.io.source import FrameSource, Item, Options

_RECORD_DEPTH = "record the depth topic"
NOTES = {
    **dict.fromkeys(CAMERAS, "intrinsics of a camera"),
    **dict.fromkeys(("sensor_msgs/Imu",), "an accelerometer, for gravity"),
    **dict.fromkeys(("tf2_msgs/TFMessage", "tf/tfMessage"), "where sensors sit to each other"),
    "stereo_msgs/DisparityImage": f"disparity, not depth; {_RECORD_DEPTH}, or turn it into depth by focal length and "
    "baseline",
    "sensor_msgs/LaserScan": "one line of distances, which shows no silo",
    "sensor_msgs/MultiEchoLaserScan": "one line of distances, which shows no silo",
    "sensor_msgs/PointCloud": "the old PointCloud; record PointCloud2",
    "livox_ros_driver/CustomMsg": "Livox's own message; record PointCloud2 (xfer_format 0)",
    "livox_ros_driver2/CustomMsg": "Livox's own message; record PointCloud2 (xfer_format 0)",
    "velodyne_msgs/VelodyneScan": "raw packets; record the PointCloud2 made of them",
    "ouster_ros/PacketMsg": "raw packets; record the PointCloud2 made of them",
    "ouster_sensor_msgs/PacketMsg": "raw packets; record the PointCloud2 made of them",
    "theora_image_transport/Packet": "a video, which loses the distances; record the raw topic",
    "ffmpeg_image_transport_msgs/FFMPEGPacket": "a video, which loses the distances; record the raw topic",
    "foxglove.CompressedVideo": "a video, which loses the distances; record RawImage",
}
"""What is said of a topic by its type; of others, that they carry no depth."""


class Contents(FrameSource):
    """A recording of which no frame can be taken as it stands: `describe` lists what is in it, iterating says why."""

    def __init__(
        self,
        path: Path,
        format: str,
        options: Options,
        why: InputError,
        streams: Sequence[Stream] = (),
        topics: Sequence[dict[str, Any]] = (),
    ) -> None:
        super().__init__(path, format, options)
        self.streams, self.why = streams, why
        self.topics = list(topics)
        self.problems = [str(why)]

    def _items(self) -> Iterator[Item]:
        raise self.why

    def _count(self) -> int | None:
        return None if self.streams else 0

    def _streams(self) -> list[dict[str, Any]]:
        return described(self.streams, None)

    def _topics(self) -> list[dict[str, Any]]:
        return self.topics


class NothingToRead(InputError):
    """A recording without depth and points; `source` describes what it has instead."""

    def __init__(self, message: str, source: Contents) -> None:
        super().__init__(message)
        self.source = source


_MOST_NAMED = 3


def summary(topics: Sequence[dict[str, Any]]) -> str:
    """Some topics with the reason, for a message."""
    told = [topic for topic in topics if topic["type"] in (*IMAGES, *COMPRESSED, *CLOUDS) or topic["type"] in NOTES]
    told = [topic for topic in told if topic["messages"]] or list(topics)
    named = "; ".join(f"{topic['name']}: {topic['note']}" for topic in told[:_MOST_NAMED])
    more = len(topics) - len(told[:_MOST_NAMED])
    return f"{named}; {more} more" if named and more else named or "it has no topics"


def listed(recording: Recording, streams: Sequence[Stream], chosen: Stream | None) -> list[dict[str, Any]]:
    """Every topic as plain data: ``name``, ``type``, ``messages``, ``read``, and a ``note`` that says why."""
    by_topic = {stream.topic.name: stream for stream in streams}
    return [
        {
            "name": topic.name,
            "type": topic.type,
            "messages": len(topic.entries),
            "read": by_topic.get(topic.name) is chosen is not None,
            "note": _note(recording, topic, by_topic.get(topic.name), chosen),
        }
        for topic in recording.topics.values()
    ]


def _note(recording: Recording, topic: Topic, stream: Stream | None, chosen: Stream | None) -> str:
    if stream is not None:
        return "read" if stream is chosen else f"{stream.kind}; choose it with --stream {stream.name}"
    if not topic.entries:
        return "no messages"
    if topic.type in (*IMAGES, *COMPRESSED, *CLOUDS):
        return _why_not(recording, topic)
    return NOTES.get(topic.type, "carries no depth")


def _why_not(recording: Recording, topic: Topic) -> str:
    """Why a topic of images or points is no stream."""
    try:
        stream_of(recording, topic)
    except InputError as error:
        return str(error)
    return "the same depth as in another topic"
