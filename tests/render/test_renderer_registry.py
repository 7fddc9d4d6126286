"""Choosing a renderer, and being told why not."""

import importlib.util

import pytest
import torch

from animator.errors import InputError
from animator.render.registry import load_renderer


def test_auto_without_cuda_is_the_cpu(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert load_renderer("auto").device == torch.device("cpu")


def test_cuda_without_a_device_names_the_driver(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(InputError, match=r"no CUDA device.*nvidia-smi.*--device cpu"):
        load_renderer("cuda")


def test_cuda_without_gsplat_names_the_extra(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(InputError, match=r"pip install 'splatimate\[gpu\]'"):
        load_renderer("cuda")


def test_an_unknown_device_lists_the_known_ones():
    with pytest.raises(InputError, match="expected one of auto, cpu, cuda, found 'tpu'"):
        load_renderer("tpu")  # type: ignore[arg-type]
