"""How many CPU threads the numeric packages may use."""


def limit_threads(count: int | None) -> None:
    """Limit torch, numba and OpenCV to some threads.

    Args:
        count: Most threads each, None to leave them as they are.
    """
    if count is None:
        return
    import cv2
    import numba
    import torch

    torch.set_num_threads(count)
    numba.set_num_threads(min(count, numba.get_num_threads()))
    cv2.setNumThreads(count)
