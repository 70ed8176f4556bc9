from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

def camera_rays(camera: Any) -> NDArray[np.float64]: ...
def check_camera(camera: Any) -> None: ...

# Files
def decode_png16(data: bytes) -> NDArray[np.uint16]: ...
