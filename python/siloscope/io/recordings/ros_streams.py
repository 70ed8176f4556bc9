"""Which topics of a ROS recording are streams of depth or points, and why the others are none."""

from __future__ import annotations

import re

from siloscope.errors import InputError
from siloscope.io.recordings import compressed_depth, messages, ros_messages
from siloscope.io.recordings.messages import CLOUDS, COMPRESSED, IMAGES
from siloscope.io.recordings.recording import Recording, Topic, or_none
from siloscope.io.recordings.streams import Stream
from siloscope.io.source import check_image_size

_INFRARED = re.compile(r"/(ir|infra)|_ir(?![a-z])|_infra", re.IGNORECASE)


def streams_of(recording: Recording) -> list[Stream]:
    """Depth and point streams; of one topic stored raw and compressed, only the raw one."""
    found = [or_none(stream_of, recording, topic) for topic in recording.of_type(*IMAGES, *COMPRESSED, *CLOUDS)]
    streams = [stream for stream in found if stream]
    raw = {stream.name for stream in streams if stream.topic.type in IMAGES}
    return [s for s in streams if s.topic.type not in COMPRESSED or image_of(s.name) not in raw]


def stream_of(recording: Recording, topic: Topic) -> Stream:
    """The stream that a topic is; raises `InputError`, saying why, where it is no depth."""
    entry = topic.entries[0]
    if topic.type in CLOUDS:
        cloud = messages.cloud(recording, topic, entry)
        size = (cloud.width, cloud.height) if cloud.height > 1 else cloud.width
        return Stream(topic.name, "points", topic, size, "float32")
    if topic.type in COMPRESSED:
        return _compressed_stream(topic, messages.compressed(recording, topic, entry))
    image = messages.image(recording, topic, entry)
    _check_depth(topic, image.encoding)
    check_image_size("the image", image.width, image.height)
    kind = "float32" if image.encoding == "32FC1" else "uint16"
    return Stream(topic.name, "depth", topic, (image.width, image.height), kind)


def _check_depth(topic: Topic, encoding: str) -> None:
    """Raises `InputError` for images that are no depth: REP 118 has 16UC1 and 32FC1, drivers mono16 and Z16 too."""
    if encoding not in ros_messages.DEPTH_ENCODINGS:
        raise InputError(f"a picture ({encoding or 'no encoding'}), not depth")
    if _INFRARED.search(topic.name):
        raise InputError("infrared, by its name")
    if encoding in ("mono16", "Z16") and "depth" not in topic.name.lower():
        raise InputError(f"{encoding} without 'depth' in its name is a grey picture")


def _compressed_stream(topic: Topic, image: compressed_depth.CompressedImage) -> Stream:
    size, kind = compressed_depth.shape_of(image, is_transported(topic, image))
    if _INFRARED.search(topic.name):
        raise InputError("infrared, by its name")
    return Stream(topic.name, "depth", topic, size, kind)


def is_transported(topic: Topic, image: compressed_depth.CompressedImage) -> bool:
    return compressed_depth.is_transported(image) or topic.name.endswith("/compressedDepth")


def image_of(topic: str) -> str:
    """The topic of the raw image that a compressed one stands for."""
    return topic.removesuffix("/compressedDepth").removesuffix("/compressed")
