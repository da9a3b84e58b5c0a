"""Arrays as the data of the page hold them."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.document.page_view import Packed


def unpacked(packed: Packed) -> NDArray[Any]:
    numbers = np.frombuffer(base64.b64decode(packed.data), f"<{packed.type}").reshape(packed.shape).astype(float)
    return numbers * (packed.scale or 1.0) + (packed.offset or 0.0)
