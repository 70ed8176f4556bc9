"""Why answers are refused and what is remarked on them: every code with what it means and what to do."""

from __future__ import annotations

from siloscope import _core

FRAME_STATUSES = {
    "used": "fused, with the weight that stands beside it",
    "rejected": "it has an answer, but one that disagrees with the other frames'",
    "before-move": "taken before the camera moved",
    "not-averaged": "older than the last 10 of the paper's rule",
    "refused": "read well, but it does not show enough wall; its reason says why",
    "unreadable": "it can't be read or used",
}
"""What becomes of a frame: stable name and what it means."""


CALIBRATION_REMARKS = {
    "camera-moved": "the camera moved during the sequence; only the frames since are fused",
    "frames-counted-before": "some frames were counted already, by the hash of their measurements; each counts once",
    "few-frames": "fewer than 3 frames agree; a wrong one could not be told from a right one",
    "many-frames-disagree": "more than a quarter of the frames disagree with the rest",
    "frames-scatter": "the frames scatter over twice as far as they state; the covariance is widened by that",
    "scale-unknown": "the depth scale is not known; a measured diameter would make every length surer",
    "cone-not-seen": "no frame shows the cone; the apex and the cylinder's bottom are unknown",
    "cylinder-not-seen": "no frame shows the cylinder; radius and cylinder's bottom are unknown",
    "sensor-mapped": "a map of the sensor's error, which foretells held-out frames, corrects the depth",
    "sensor-not-mapped": "no map of the sensor's error was kept: none foretells held-out frames",
    "deformed": "the wall departs from a cylinder by more than walls do; look for a deposit, or another shape",
}
"""Remarks on a calibration: stable code and what it means."""


CALIBRATION_REFUSALS = {
    "no-frame-answers": (
        "none of the frames shows enough wall",
        "take frames at a lower level, or turn the camera so that more of the wall is in view",
    ),
    "frames-disagree": (
        "the frames' answers scatter too far to be of one camera in one silo",
        "check that all frames are of one camera in one silo, and what each of them says",
    ),
    "poorly-determined": (
        "the frames agree, but together they show too little wall to fix the axis",
        "go on with frames at a lower level, or turn the camera so that more of the wall is in view",
    ),
}
"""Why there is no calibration: what it means, and what to try."""


CONTENT_REMARKS: dict[str, tuple[str, str]] = {
    "too-little-seen": (
        "too little of the content's surface is seen to tell how much there is",
        "clean the lens, free the view, or turn the camera so that it looks at the middle of the silo",
    ),
    "partly-seen": (
        "less than a third of the surface is seen; the rest is continued from its slope",
        "mind the larger deviation; a camera farther from the wall or with a wider view sees more",
    ),
    "sensor-buried": (
        "nearly everything measured is far nearer than the sensor can measure",
        "look whether the sensor is buried in feed, caked, or covered, and measure again when it is free",
    ),
    "dust-or-fog": (
        "many single returns float between sensor and surface, as dust or fog make them",
        "measure again when filling is over and the dust has settled",
    ),
    "lens-film": (
        "large parts of the picture that should show the silo within the sensor's range show nothing",
        "clean the window; in a cold silo warm it against condensation",
    ),
    "obstruction": (
        "something hangs or stands between sensor and surface",
        "look what it is; the surface behind it is continued from around it",
    ),
    "stuck-feed": (
        "feed hangs on the wall above the surface",
        "its volume is not counted; knock the silo free, and look for a bridge",
    ),
    "rathole": (
        "the surface has a steep hole",
        "the flow comes through a pipe in the feed; it may collapse at once, keep out and have it broken up",
    ),
    "filling-in-progress": (
        "the surface moved since the frame before",
        "measure again when filling or emptying is over; this reading belongs to its own moment",
    ),
    "camera-moved": (
        "the wall no longer lies where the calibration has it",
        "calibrate anew with frames taken since the camera was moved",
    ),
    "bottom-unknown": (
        "there is no volume: what lies under the surface is not known",
        "say what the bottom is (bottom, cone or vessel), or calibrate with frames of the empty vessel (empty)",
    ),
    "vessel-contradicted": (
        "what was given of the vessel contradicts what is seen",
        "check the numbers that were given, and whether the frames are of this vessel",
    ),
    "radius-unknown": (
        "the silo's radius is not known, so nothing bounds the surface",
        "give the diameter, say that the cone seen is the bottom if it is, or calibrate with frames of a lower level",
    ),
    "beyond-range": (
        "the surface lies farther away than the sensor can measure",
        "the silo may be nearly empty; a sensor of a longer range would tell",
    ),
    "below-the-floor": (
        "much of what is seen lies below the silo's floor",
        "check that calibration and frame are of one silo and one camera",
    ),
}
"""Code: what it means, what to do."""


BOTTOM_KINDS = ("cone", "flat", "oblique", "two-stage", "pyramid", "wedge", "map", "unknown")
"""Kinds of bottom. A map is a floor as it was seen, whatever its shape."""


BOTTOM_EVIDENCE = {
    "datasheet": "lengths that were given",
    "told": "the user says that the conical surface seen is the bottom",
    "tare": "frames of the empty vessel",
    "steep": "the surface seen is steeper than feed can lie",
    "unchanged": "the surface seen was in the same place before and after a fill and a draw-down",
    "discharge": "the lowest surface seen at each place of a discharge that a refill confirmed",
}
"""How a bottom is known."""


INPUT_REMARKS: dict[str, tuple[str, str]] = {
    "outside-sensor-range": (
        "much of the depth lies where this sensor can't measure",
        "check depth unit and sensor; trust range takes the depth as it is",
    ),
    "unusual-depth-unit": (
        "the depth unit given is not the one that this sensor's makers set",
        "check the depth unit against what the recorder was set to",
    ),
    "millimetre-depth-unit": (
        "the depth unit given is a millimetre, which is not this sensor's own",
        "check that the frame was stored in millimetres, as ROS does",
    ),
    "axes-found": (
        "the points do not lie along the file's z axis, so the cloud was turned to the optical frame",
        "give axes or up where that is not how the sensor looks",
    ),
    "gravity-behind": (
        "gravity points out of the camera's back, and was turned round",
        "an accelerometer at rest reads minus gravity: turn all three signs; where the camera looks upwards, z of the "
        "answer points up",
    ),
    "upside-down": (
        "most of what is seen lies on the other side of the origin than the answer's z points",
        "give up, the file's axis that points upwards, or gravity",
    ),
    "kinect-raw": (
        "the values look like the first Kinect's raw 11-bit disparity, which is no depth",
        "record depth in millimetres (libfreenect: FREENECT_DEPTH_MM or FREENECT_DEPTH_REGISTERED)",
    ),
    "hole-filled": (
        "holes of the frame were filled with values from beside them, which nobody measured",
        "record without post-processing: no hole filling, no spatial filter that fills holes",
    ),
    "ray-length-as-depth": (
        "the values may be lengths of rays, not depths along the optical axis",
        "renderers and laser scanners write those: read them with ray length",
    ),
    "disparity-as-depth": (
        "the values may be disparities: what is near has large ones",
        "convert them first: depth = focal length · baseline / disparity",
    ),
    "another-streams-camera": (
        "the camera may be another stream's: its focal length is none of this sensor's depth images",
        "check the camera file: the colour camera's intrinsics do not fit depth, nor do those of another resolution",
    ),
    "focal-lengths-differ": (
        "the camera's two focal lengths differ, as those of square pixels don't",
        "check fx and fy: one of them may be of another stream or resolution",
    ),
    "principal-point-aside": (
        "the camera's principal point lies far from the middle of the image",
        "check cx, cy, width and height: they may be of another stream or resolution; a cut-out is right so",
    ),
    "intrinsics-contradicted": (
        "the wall is round only with intrinsics far from those given",
        "check the camera file: it must be that of the depth stream at this size; trust camera keeps the answer",
    ),
    "depth-bias-contradicted": (
        "the wall needs a depth error that this sensor does not have",
        "check sensor, depth unit and the camera file; trust bias keeps the answer",
    ),
    "diameter-contradicted": (
        "the diameter given contradicts what the sensor measures",
        "check the tape, the depth unit and the camera file: the colour camera's intrinsics do not fit depth; "
        "trust diameter takes the diameter's word",
    ),
    "option-unused": (
        "an option was given that can't act on this input",
        "leave it out, or see its help for what it acts on",
    ),
    "gravity-contradicts": (
        "the silo's axis is not along gravity",
        "check gravity's signs and that it is in the camera's frame; trust gravity keeps the answer",
    ),
}
"""Codes of what a frame's inputs say against each other: what it means, what to do."""


REMARKS = {refusal.slug: (refusal.meaning, refusal.remedy) for refusal in _core.refusals()}
REMARKS |= INPUT_REMARKS | CONTENT_REMARKS
"""Every code of a remark on an estimate or a reading: what it means, what to do."""


def calibration_remark(code: str) -> dict[str, str]:
    """A remark on a calibration as plain data: its code, what it means with what to do, and how grave it is."""
    meaning, advice = REMARKS.get(code, ("", ""))
    message = CALIBRATION_REMARKS.get(code) or f"{meaning}; {advice}"
    return {"code": code, "message": message, "severity": "note" if code in NOTES else "warning"}


NOTES = (
    "few-frames",
    "scale-unknown",
    "cone-not-seen",
    "cylinder-not-seen",
    "partly-seen",
    "bottom-unknown",
    "filling-in-progress",
    "millimetre-depth-unit",
    "axes-found",
    "option-unused",
)
"""Codes that only inform; the others warn."""


CONTENT_REFUSALS = (
    "dust-or-fog",
    "too-little-seen",
    "radius-unknown",
    "beyond-range",
    "sensor-buried",
    "camera-moved",
    "below-the-floor",
)
"""Codes that may leave a reading without an answer; the others come beside one."""


def estimate_refusals() -> dict[str, tuple[str, str]]:
    """Every reason for a refusal: what it means, and what to try."""
    return {refusal.slug: (refusal.meaning, refusal.remedy) for refusal in _core.refusals()}


def sentence(reason: tuple[str, str], detail: str = "") -> str:
    """What a reason means, with a detail, and what to try."""
    meaning, advice = reason
    return f"{meaning[0].upper()}{meaning[1:]}{detail}; {advice}."
