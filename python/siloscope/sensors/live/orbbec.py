"""A live Orbbec camera by `pyorbbecsdk2` (extra ``orbbec``). No camera was at hand to try it on."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Self

import numpy as np

from siloscope.errors import InputError
from siloscope.io.extras import need
from siloscope.io.recordings.ros_messages import camera
from siloscope.io.recordings.vendors.orbbec import DISTORTION
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame

_WAIT_MS = 5000


class Orbbec:
    """The depth stream of the first camera, running; use it in a ``with`` statement."""

    def __init__(self, sdk: Any) -> None:
        self._sdk = sdk
        try:
            self._pipeline = sdk.Pipeline()
            info = self._pipeline.get_device().get_device_info()
            self.name = str(info.get_name())
            profiles = self._pipeline.get_stream_profile_list(sdk.OBSensorType.DEPTH_SENSOR)
            self._profile = profiles.get_default_video_stream_profile()
            self.camera = self._intrinsics()
        except sdk.OBError as error:
            raise InputError(f"no Orbbec camera can be used ({error}); plug it into a USB 3 socket") from None

    def _intrinsics(self) -> Camera:
        video = self._profile.as_video_stream_profile()
        lens, d = video.get_intrinsic(), video.get_distortion()
        model = getattr(d, "model", None)
        name = "rational" if model is None else DISTORTION[int(getattr(model, "value", model))]
        fisheye = name == "kannala brandt"
        radial = (d.k1, d.k2, d.k3, d.k4) if fisheye else (d.k1, d.k2, d.p1, d.p2, d.k3, d.k4, d.k5, d.k6)
        focal = lens.fx, lens.fy, lens.cx, lens.cy
        return camera(self.name, (video.get_width(), video.get_height()), focal, name, tuple(map(float, radial)))

    def __enter__(self) -> Self:
        config = self._sdk.Config()
        config.enable_stream(self._profile)
        try:
            self._pipeline.start(config)
        except self._sdk.OBError as error:
            raise InputError(f"{self.name}: can't be started ({error}); is another program using it?") from None
        return self

    def newest(self) -> Frame:
        """The newest depth frame."""
        frames = self._pipeline.wait_for_frames(_WAIT_MS)
        depth = frames.get_depth_frame() if frames is not None else None
        if depth is None:
            raise InputError(f"{self.name}: no depth frame for {_WAIT_MS / 1000:.0f} s; check its cable")
        size = depth.get_height(), depth.get_width()
        pixels = np.frombuffer(depth.get_data(), np.uint16)
        if pixels.size != size[0] * size[1]:
            raise InputError(f"{self.name}: depth comes as {depth.get_format()}, which is not read; choose Y16")
        return Frame(
            depth=pixels.reshape(size).copy(),
            camera=self.camera,
            depth_unit=float(depth.get_depth_scale()) * 1e-3,
            timestamp=float(depth.get_system_timestamp_us()) * 1e-6,
            source=f"{self.name}, frame {depth.get_index()}",
            provenance={"device": self.name, "depth_unit_from": "SDK"},
        )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pipeline.stop()


def open_first() -> Orbbec:
    """The first camera connected; raises `InputError` where there is none, or the SDK is missing."""
    return Orbbec(need("pyorbbecsdk", "orbbec", "a live Orbbec camera"))
