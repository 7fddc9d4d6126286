"""Threads where they do not change the result.

Our own kernels give the same bytes on any number of threads. torch's sums and OpenCV's optical flow do not: both cut
their work by the number of threads. While a clip is fitted they run on one, which costs little, for the time goes into
our kernels.
"""

import contextlib
from collections.abc import Iterator

import cv2
import torch


@contextlib.contextmanager
def same_bytes_on_any_threads() -> Iterator[None]:
    """Run torch and OpenCV on one thread, and give them back theirs afterwards."""
    torch_threads, cv2_threads = torch.get_num_threads(), cv2.getNumThreads()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        torch.set_num_threads(torch_threads)
        cv2.setNumThreads(cv2_threads)
