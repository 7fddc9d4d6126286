import cv2
import pytest
import torch

from animator.threads import same_bytes_on_any_threads


def test_threads_are_given_back_even_after_an_error():
    before = torch.get_num_threads(), cv2.getNumThreads()
    with pytest.raises(KeyboardInterrupt), same_bytes_on_any_threads():
        assert (torch.get_num_threads(), cv2.getNumThreads()) == (1, 1)
        raise KeyboardInterrupt
    assert (torch.get_num_threads(), cv2.getNumThreads()) == before
