"""A record whose texts try to break out of the page."""

import dataclasses
import math

import pytest

from animator.report.quality import FrameQuality, Spread
from animator.report.record import FrameRow, RunRecord, summarize

EVIL = '<script src="https://evil.example/x.js">&"\'</script>'


def quality_of(iou: float, psnr_db: float = 20.0) -> FrameQuality:
    return FrameQuality(
        psnr_db=psnr_db,
        silhouette_iou=iou,
        rigid_residual_percent=math.nan,
        skin_error_percent=1e-5,
        unseen_share=0.5,
        never_seen_share=0.25,
    )


@pytest.fixture
def record() -> RunRecord:
    rows = tuple(
        FrameRow(
            number=6 * index,
            name=EVIL,
            time_s=index / 24,
            matches=100 * index,
            reprojection_px=1.5 if index else math.nan,
            start=EVIL,
            groups=index,
            quality=dataclasses.replace(
                quality_of(0.9 - 0.2 * index, 20.0 if index else math.nan),
                uncertainty_along_percent=Spread(median=0.5, p95=2.0) if index else Spread(),
            ),
            seconds={"match": 0.5, "image stage": 1.25},
        )
        for index in range(3)
    )
    return RunRecord(
        name=EVIL,
        inputs={"frames": 3, "fps": 24.0},
        choices=(EVIL, "Masks: the images' alpha."),
        settings={"out": [EVIL], "every": None, "seed": 0},
        versions={"python": "3"},
        outputs=(EVIL,),
        seconds={"read": 1.0, "fit": 2.0},
        rows=rows,
        summary=summarize([row.quality for row in rows], min_iou=0.5),
    )
