"""Calibration files as other programs write them, all of one camera."""

from __future__ import annotations

import json

from siloscope import Camera

SIZE = (320, 240)
CAMERA = Camera(*SIZE, 281.5, 282.25, 161.5, 118.75)
K5 = (0.11, -0.21, 0.0015, -0.0005, 0.031)
DISTORTED = Camera(*SIZE, 281.5, 282.25, 161.5, 118.75, "brown_conrady", K5)

OPENCV_YAML = """%YAML:1.0
---
calibration_time: "Tue Nov  3 10:12:13 2026"
nr_of_frames: 21
image_width: 320
image_height: 240
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 2.8150000000000000e+02, 0., 1.6150000000000000e+02, 0.,
       2.8225000000000000e+02, 1.1875000000000000e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 1.1e-01, -2.1e-01, 1.5e-03, -5.0e-04, 3.1e-02 ]
avg_reprojection_error: 2.5e-01
"""
OPENCV_XML = """<?xml version="1.0"?>
<!-- written by a calibration -->
<opencv_storage>
<image_Width>320</image_Width>
<image_Height>240</image_Height>
<Camera_Matrix type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    281.5 0. 161.5 0. 282.25
    118.75 0. 0. 1.</data></Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix">
  <rows>5</rows>
  <cols>1</cols>
  <dt>d</dt>
  <data>
    0.11 -0.21 0.0015 -0.0005 0.031</data></Distortion_Coefficients>
</opencv_storage>
"""
KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [0.11, -0.21, 0.0015, -0.0005]
  distortion_model: radtan
  intrinsics: [281.5, 282.25, 161.5, 118.75]
  resolution: [320, 240]
  rostopic: /depth/image_raw
cam1:
  camera_model: pinhole
  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]
  distortion_model: equidistant
  intrinsics: [700.0, 700.0, 640.0, 400.0]
  resolution: [1280, 800]
"""
MATRIX: list[list[float]] = [[281.5, 0, 161.5], [0, 282.25, 118.75], [0, 0, 1]]
FOUR: list[list[float]] = [[*row, 0] for row in MATRIX] + [[0, 0, 0, 1]]


def rows(matrix: list[list[float]], between: str) -> str:
    return "\n".join(between.join(f"{value:.18e}" for value in row) for row in matrix) + "\n"


COLMAP = "# Camera list\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: 1\n"
SCANNET = """axisAlignment = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
colorHeight = 968
colorWidth = 1296
depthHeight = 240
depthWidth = 320
fx_color = 1165.7
fx_depth = 281.5
fy_depth = 282.25
mx_depth = 161.5
my_depth = 118.75
"""
SENSOR_INFO = """m_versionNumber = 4
m_depthWidth = 320
m_depthHeight = 240
m_depthShift = 1000
m_calibrationDepthIntrinsic = 281.5 0 161.5 0 0 282.25 118.75 0 0 0 1 0 0 0 0 1
"""
VIEWER = """Frame Info:\x20
Type,Depth
Format,Z16
Frame Number,7
Resolution x,320
Resolution y,240
Bytes per pixel,2

Intrinsic:,
Fx,281.500000
Fy,282.250000
PPx,161.500000
PPy,118.750000
Distorsion,Brown Conrady
"""
BOP_IMAGES = {str(i): {"cam_K": [v for row in MATRIX for v in row], "depth_scale": 0.1} for i in range(3)}
BOP_CAMERA = {
    "cx": 161.5, "cy": 118.75, "depth_scale": 1.0, "fx": 281.5, "fy": 282.25, "height": 240, "width": 320,
}  # fmt: skip
RECORD3D = {
    "w": 1280, "h": 960, "dw": 320, "dh": 240, "fps": 60, "poses": [],
    "K": [1126.0, 0, 0, 0, 1129.0, 0, 647.5, 476.5, 1],
}  # fmt: skip
DEPTHAI = {
    "boardName": "OAK-D",
    "cameraData": [
        [0, {"width": 0, "height": 0, "intrinsicMatrix": [[0, 0, 0]] * 3}],
        [2, {"width": 320, "height": 240, "intrinsicMatrix": MATRIX, "distortionCoeff": [*K5, *[0.0] * 9]}],
    ],
}

PLAIN = {
    "3 x 3 text": rows(MATRIX, " "),
    "3 x 3 CSV": rows(MATRIX, ","),
    "4 x 4 text of ScanNet": rows(FOUR, " "),
    "3 x 4 projection": rows(FOUR[:3], "\t"),
    "printed matrix": f"[[{'],['.join(' '.join(map(str, row)) for row in MATRIX)}]]",
    "COLMAP PINHOLE": COLMAP + "1 PINHOLE 320 240 281.5 282.25 162 119.25\n",
    "ScanNet": SCANNET,
    "ScanNet sensor info": SENSOR_INFO,
    "Viewer": VIEWER,
    "printed by pyrealsense2": "depth: [ 320x240  p[161.5 118.75]  f[281.5 282.25]  Brown Conrady [0 0 0 0 0] ]\n",
    "printed by an older one": "width: 320, height: 240, ppx: 161.5, ppy: 118.75, fx: 281.5, fy: 282.25, "
    "model: Brown Conrady, coeffs: [0.0, 0.0, 0.0, 0.0, 0.0]",
    "JSON of a detector": json.dumps({"K": MATRIX, "dist": [0, 0, 0, 0, 0]}),
    "NeRF transforms": json.dumps({"fl_x": 281.5, "fl_y": 282.25, "cx": 161.5, "cy": 118.75, "w": 320, "h": 240}),
    "JSON without a size": json.dumps({"fx": 281.5, "fy": 282.25, "cx": 161.5, "cy": 118.75}),
    "BOP images": json.dumps(BOP_IMAGES),
    "BOP camera": json.dumps(BOP_CAMERA),
}
ORB_SLAM = """%YAML:1.0
Camera.type: "PinHole"
Camera.fx: 281.5
Camera.fy: 282.25
Camera.cx: 161.5
Camera.cy: 118.75
Camera.k1: 0.11
Camera.k2: -0.21
Camera.p1: 0.0015
Camera.p2: -0.0005
Camera.k3: 0.031
Camera.width: 320
Camera.height: 240
Camera.fps: 30.0
DepthMapFactor: 5000.0
"""
LENSES = {
    "OpenCV YAML": OPENCV_YAML,
    "OpenCV YAML, older": OPENCV_YAML.replace("---\n", "").replace("camera_matrix", "CameraMat"),
    "OpenCV XML": OPENCV_XML,
    "ORB-SLAM": ORB_SLAM,
    "ORB-SLAM3": ORB_SLAM.replace("Camera.", "Camera1.")
    .replace("Camera1.width", "Camera.width")
    .replace("Camera1.height", "Camera.height"),
    "JSON in OpenCV's names": json.dumps({"cameraMatrix": MATRIX, "distCoeffs": [list(K5)]}),
    "OAK calibration": json.dumps(DEPTHAI),
    "stereo pair": OPENCV_YAML.replace("camera_matrix", "M1").replace("distortion_coefficients", "D1"),
}
