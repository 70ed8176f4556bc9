"""Who wrote a recording: the container is the same, what the messages mean is not."""

from __future__ import annotations

from pathlib import Path

from siloscope.errors import InputError
from siloscope.io.recordings.contents import Contents, NothingToRead, listed, summary
from siloscope.io.recordings.recording import Recording
from siloscope.io.recordings.streams import NoStreams, SeveralStreams
from siloscope.io.source import FrameSource, Options


def source(path: Path, format: str, options: Options, recording: Recording) -> FrameSource:
    """The source of frames for a recording, by its topics; closes the recording where none can be read."""
    from siloscope.io.recordings.vendors import orbbec, realsense, ros

    try:
        if realsense.is_realsense(recording):
            return realsense.RealSenseSource(path, f"realsense-{format}", options, recording)
        if orbbec.is_orbbec(recording):
            return orbbec.OrbbecSource(path, f"orbbec-{format}", options, recording)
        return ros.RosSource(path, format, options, recording)
    except SeveralStreams as why:
        topics = listed(recording, why.streams, None)
        recording.close()
        return Contents(path, format, options, why, why.streams, topics)
    except NoStreams as none:
        topics = listed(recording, (), None)
        recording.close()
        told = f"{none}: {summary(topics)}"
        raise NothingToRead(told, Contents(path, format, options, InputError(told), (), topics)) from None
    except InputError as error:
        recording.close()
        raise error if recording.name in str(error) else InputError(f"{recording.name}: {error}") from None
    except BaseException:
        recording.close()
        raise
