"""Threads where they do not change the result.

Our own kernels give the same bytes on any number of threads. torch's sums, OpenCV's optical flow and
BLAS do not: they cut their work by the number of threads. While a clip is fitted they run on one, which costs little,
for the time goes into our kernels. (OpenBLAS on all threads of a busy machine also stalls, for half a second at times.)
"""

import contextlib
from collections.abc import Iterator

import cv2
import torch
from threadpoolctl import threadpool_limits


@contextlib.contextmanager
def same_bytes_on_any_threads() -> Iterator[None]:
    """Run torch, OpenCV and BLAS on one thread, and give them back theirs afterwards."""
    torch_threads, cv2_threads = torch.get_num_threads(), cv2.getNumThreads()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1, user_api="blas"):
            yield
    finally:
        torch.set_num_threads(torch_threads)
        cv2.setNumThreads(cv2_threads)
